#include "drivers/camera/v4l2_device.h"

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>

#include <fcntl.h>
#include <linux/videodev2.h>
#include <sys/ioctl.h>

#include "drivers/camera/grey_conversion.h"

namespace vantage {
namespace {

namespace fs = std::filesystem;

double rate_of(const v4l2_fract& interval) {
  return interval.numerator == 0 ? 0 : static_cast<double>(interval.denominator) / interval.numerator;
}

std::vector<double> rates_of(int fd, std::uint32_t fourcc, int width, int height) {
  std::vector<double> rates;
  v4l2_frmivalenum interval{};
  interval.pixel_format = fourcc;
  interval.width = static_cast<std::uint32_t>(width);
  interval.height = static_cast<std::uint32_t>(height);
  for (; retried_ioctl(fd, VIDIOC_ENUM_FRAMEINTERVALS, &interval) == 0; ++interval.index) {
    if (interval.type == V4L2_FRMIVAL_TYPE_DISCRETE) {
      rates.push_back(rate_of(interval.discrete));
    } else {
      rates.push_back(rate_of(interval.stepwise.min));
      rates.push_back(rate_of(interval.stepwise.max));
      break;
    }
  }
  std::sort(rates.rbegin(), rates.rend());
  return rates;
}

std::vector<CameraSize> sizes_of(int fd, std::uint32_t fourcc) {
  std::vector<CameraSize> sizes;
  const auto add = [&](std::uint32_t width, std::uint32_t height) {
    const int w = static_cast<int>(width), h = static_cast<int>(height);
    sizes.push_back({w, h, rates_of(fd, fourcc, w, h)});
  };
  v4l2_frmsizeenum size{};
  size.pixel_format = fourcc;
  for (; retried_ioctl(fd, VIDIOC_ENUM_FRAMESIZES, &size) == 0; ++size.index) {
    if (size.type == V4L2_FRMSIZE_TYPE_DISCRETE) {
      add(size.discrete.width, size.discrete.height);
    } else {
      add(size.stepwise.min_width, size.stepwise.min_height);
      add(size.stepwise.max_width, size.stepwise.max_height);
      break;
    }
  }
  return sizes;
}

/// Nodes /dev/videoN in the order of N.
std::vector<fs::path> video_nodes() {
  std::vector<std::pair<int, fs::path>> nodes;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator("/dev", error)) {
    int number = 0;
    const std::string name = entry.path().filename().string();
    if (std::sscanf(name.c_str(), "video%d", &number) == 1) nodes.emplace_back(number, entry.path());
  }
  std::sort(nodes.begin(), nodes.end());
  std::vector<fs::path> paths;
  paths.reserve(nodes.size());
  for (auto& [number, path] : nodes) paths.push_back(std::move(path));
  return paths;
}

fs::path stable_name_of(const fs::path& node) {
  std::error_code error;
  for (const char* folder : {"/dev/v4l/by-id", "/dev/v4l/by-path"}) {
    for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
      if (fs::equivalent(entry.path(), node, error)) return entry.path();
    }
  }
  return {};
}

}  // namespace

int retried_ioctl(int fd, unsigned long request, void* argument) {
  int result = -1;
  do {
    result = ::ioctl(fd, request, argument);
  } while (result < 0 && errno == EINTR);
  return result;
}

FileDescriptor open_video(const fs::path& node) {
  return FileDescriptor(::open(node.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC));
}

std::optional<CameraIdentity> identify(int fd) {
  v4l2_capability capability{};
  if (retried_ioctl(fd, VIDIOC_QUERYCAP, &capability) != 0) return {};
  const std::uint32_t can =
      (capability.capabilities & V4L2_CAP_DEVICE_CAPS) != 0 ? capability.device_caps : capability.capabilities;
  if ((can & V4L2_CAP_VIDEO_CAPTURE) == 0 || (can & V4L2_CAP_STREAMING) == 0) return {};
  const auto text = [](const std::uint8_t* bytes, std::size_t size) {
    const char* chars = reinterpret_cast<const char*>(bytes);
    return std::string(chars, ::strnlen(chars, size));
  };
  return CameraIdentity{text(capability.driver, sizeof capability.driver),
                        text(capability.card, sizeof capability.card),
                        text(capability.bus_info, sizeof capability.bus_info)};
}

std::vector<CameraFormat> formats_of(int fd) {
  std::vector<CameraFormat> formats;
  v4l2_fmtdesc format{};
  format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  for (; retried_ioctl(fd, VIDIOC_ENUM_FMT, &format) == 0; ++format.index) {
    formats.push_back(
        {format.pixelformat, reinterpret_cast<const char*>(format.description), sizes_of(fd, format.pixelformat)});
  }
  return formats;
}

std::vector<CameraDescription> find_cameras() {
  std::vector<CameraDescription> cameras;
  for (const fs::path& node : video_nodes()) {
    const FileDescriptor device = open_video(node);
    if (!device.valid()) continue;
    const std::optional<CameraIdentity> identity = identify(device.get());
    if (identity) cameras.push_back({node, stable_name_of(node), *identity, formats_of(device.get())});
  }
  return cameras;
}

std::string to_text(const CameraDescription& camera) {
  std::string text = camera.node.string() + ": " + camera.identity.card + " (" + camera.identity.driver + ", " +
                     camera.identity.bus + ")\n";
  if (!camera.stable_name.empty()) text += "  stable name " + camera.stable_name.string() + "\n";
  for (const CameraFormat& format : camera.formats) {
    text += "  " + fourcc_text(format.fourcc) + " " + format.description +
            (pixel_format(format.fourcc) ? "\n" : " (can't be used)\n");
    if (!pixel_format(format.fourcc)) continue;
    for (const CameraSize& size : format.sizes) {
      text += "    " + std::to_string(size.width) + " x " + std::to_string(size.height) + ":";
      for (const double rate : size.rates_hz) {
        char hz[32];
        std::snprintf(hz, sizeof hz, " %.4g", rate);
        text += hz;
      }
      text += size.rates_hz.empty() ? " frame rate not told\n" : " Hz\n";
    }
  }
  return text;
}

fs::path find_node(const fs::path& device, const CameraIdentity& identity) {
  const auto identity_at = [](const fs::path& node) -> std::optional<CameraIdentity> {
    const FileDescriptor opened = open_video(node);
    return opened.valid() ? identify(opened.get()) : std::nullopt;
  };
  std::error_code error;
  const bool is_link = fs::is_symlink(device, error);
  if (const auto there = identity_at(device)) {
    // udev's link means this very camera, in whatever socket it is plugged now; a number means nothing.
    if (*there == identity || (is_link && there->driver == identity.driver && there->card == identity.card)) {
      return device;
    }
  }
  if (is_link) return {};
  for (const fs::path& node : video_nodes()) {
    if (identity_at(node) == identity) return node;
  }
  return {};
}

}  // namespace vantage
