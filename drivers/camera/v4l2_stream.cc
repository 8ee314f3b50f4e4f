#include "drivers/camera/v4l2_stream.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>

#include <linux/videodev2.h>
#include <sys/mman.h>

namespace vantage {
namespace {

constexpr int kLeastBuffers = 4;

bool fail(std::string* why, const std::string& reason) {
  *why = reason;
  return false;
}

std::string with_error(const std::string& what) { return what + ": " + std::strerror(errno); }

/// Formats that the device offers and that can become grey, best first.
std::vector<std::uint32_t> usable(const std::vector<CameraFormat>& offered) {
  std::vector<std::uint32_t> codes;
  for (const CameraFormat& format : offered) {
    if (pixel_format(format.fourcc)) codes.push_back(format.fourcc);
  }
  std::stable_sort(codes.begin(), codes.end(), [](std::uint32_t a, std::uint32_t b) {
    return preference(*pixel_format(a)) < preference(*pixel_format(b));
  });
  return codes;
}

std::string list_of(const std::vector<CameraFormat>& offered) {
  std::string text;
  for (const CameraFormat& format : offered) text += (text.empty() ? "" : ", ") + fourcc_text(format.fourcc);
  return text.empty() ? "none" : text;
}

v4l2_buffer empty_buffer(std::uint32_t index) {
  v4l2_buffer buffer{};
  buffer.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  buffer.memory = V4L2_MEMORY_MMAP;
  buffer.index = index;
  return buffer;
}

}  // namespace

std::shared_ptr<V4l2Stream> V4l2Stream::open(const std::filesystem::path& node, const StreamOptions& options,
                                             std::string* why) {
  std::shared_ptr<V4l2Stream> stream(new V4l2Stream);
  stream->device_ = open_video(node);
  const auto refuse = [&](const std::string& reason) {
    *why = node.string() + ": " + reason;
    return nullptr;
  };
  if (!stream->device_.valid()) return refuse(with_error("can't be opened"));
  const std::optional<CameraIdentity> identity = identify(stream->fd());
  if (!identity) return refuse("is no camera that streams; vantage-onboard --list-cameras shows those that do");
  stream->identity_ = *identity;
  std::string reason;
  if (!stream->set_format(options, &reason)) return refuse(reason);
  V4l2Controls controls(stream->fd());
  stream->settings_ = fix_settings(controls, options.settings);
  if (!stream->map_buffers(std::max(options.buffers, kLeastBuffers), &reason)) return refuse(reason);
  if (!stream->start()) return refuse(with_error("does not start to stream"));
  return stream;
}

V4l2Stream::~V4l2Stream() {
  close();
  for (const std::span<std::uint8_t> buffer : buffers_) ::munmap(buffer.data(), buffer.size());
}

bool V4l2Stream::set_format(const StreamOptions& options, std::string* why) {
  const std::vector<CameraFormat> offered = formats_of(fd());
  std::vector<std::uint32_t> wanted = usable(offered);
  if (!options.format.empty()) {
    std::erase_if(wanted, [&](std::uint32_t code) { return fourcc_text(code) != options.format; });
    if (wanted.empty()) {
      return fail(why, "does not offer the format " + options.format + "; it offers " + list_of(offered));
    }
  }
  if (wanted.empty()) return fail(why, "offers no format that can become grey; it offers " + list_of(offered));
  std::string refused;
  for (const std::uint32_t code : wanted) {
    v4l2_format format{};
    format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    format.fmt.pix.width = static_cast<std::uint32_t>(options.width);
    format.fmt.pix.height = static_cast<std::uint32_t>(options.height);
    format.fmt.pix.pixelformat = code;
    format.fmt.pix.field = V4L2_FIELD_NONE;
    if (retried_ioctl(fd(), VIDIOC_S_FMT, &format) != 0) {
      refused = fourcc_text(code) + " is refused: " + std::strerror(errno) +
                (errno == EBUSY ? "; another program uses the camera" : "");
      continue;
    }
    // The driver changes what it does not like, without an error.
    const v4l2_pix_format& kept = format.fmt.pix;
    if (kept.pixelformat != code || kept.width != static_cast<std::uint32_t>(options.width) ||
        kept.height != static_cast<std::uint32_t>(options.height)) {
      refused = fourcc_text(code) + " " + std::to_string(options.width) + " x " + std::to_string(options.height) +
                " becomes " + fourcc_text(kept.pixelformat) + " " + std::to_string(kept.width) + " x " +
                std::to_string(kept.height);
      continue;
    }
    if (kept.field != V4L2_FIELD_NONE && kept.field != V4L2_FIELD_ANY) {
      refused = fourcc_text(code) + " comes interlaced";
      continue;
    }
    fourcc_ = code;
    format_ = *pixel_format(code);
    width_ = options.width;
    height_ = options.height;
    bytes_per_line_ = kept.bytesperline;
    if (kept.sizeimage < least_bytes(format_, width_, height_, bytes_per_line_)) {
      refused = fourcc_text(code) + " has buffers smaller than its picture";
      continue;
    }
    v4l2_streamparm parameters{};
    parameters.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    parameters.parm.capture.timeperframe = {1000, static_cast<std::uint32_t>(std::lround(options.rate_hz * 1000))};
    retried_ioctl(fd(), VIDIOC_S_PARM, &parameters);
    const v4l2_fract& period = parameters.parm.capture.timeperframe;
    rate_hz_ = period.numerator == 0 || period.denominator == 0
                   ? options.rate_hz
                   : static_cast<double>(period.denominator) / period.numerator;
    return true;
  }
  return fail(why, refused + "; vantage-onboard --list-cameras shows what it offers");
}

bool V4l2Stream::map_buffers(int count, std::string* why) {
  v4l2_requestbuffers request{};
  request.count = static_cast<std::uint32_t>(count);
  request.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  request.memory = V4L2_MEMORY_MMAP;
  if (retried_ioctl(fd(), VIDIOC_REQBUFS, &request) != 0) {
    return fail(why, with_error(errno == EBUSY ? "another program streams from it" : "gives no buffers"));
  }
  if (request.count < kLeastBuffers) return fail(why, "has fewer than four buffers");
  for (std::uint32_t i = 0; i < request.count; ++i) {
    v4l2_buffer buffer = empty_buffer(i);
    if (retried_ioctl(fd(), VIDIOC_QUERYBUF, &buffer) != 0) return fail(why, with_error("a buffer can't be had"));
    void* memory = ::mmap(nullptr, buffer.length, PROT_READ | PROT_WRITE, MAP_SHARED, fd(), buffer.m.offset);
    if (memory == MAP_FAILED) return fail(why, with_error("a buffer can't be mapped"));
    buffers_.emplace_back(static_cast<std::uint8_t*>(memory), buffer.length);
  }
  with_driver_.assign(buffers_.size(), false);
  return true;
}

bool V4l2Stream::queue(std::uint32_t index) {
  v4l2_buffer buffer = empty_buffer(index);
  with_driver_[index] = retried_ioctl(fd(), VIDIOC_QBUF, &buffer) == 0;
  return with_driver_[index];
}

bool V4l2Stream::start() {
  const std::lock_guard lock(mutex_);
  for (std::uint32_t i = 0; i < buffers_.size(); ++i) {
    if (!queue(i)) return false;
  }
  int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  streaming_ = retried_ioctl(fd(), VIDIOC_STREAMON, &type) == 0;
  return streaming_;
}

int V4l2Stream::queued() const {
  const std::lock_guard lock(mutex_);
  return static_cast<int>(std::count(with_driver_.begin(), with_driver_.end(), true));
}

V4l2Stream::Take V4l2Stream::take(Buffer* taken) {
  v4l2_buffer buffer = empty_buffer(0);
  if (retried_ioctl(fd(), VIDIOC_DQBUF, &buffer) != 0) {
    if (errno == EAGAIN) return Take::kNothing;
    return errno == ENODEV || errno == ENXIO || errno == EBADF ? Take::kGone : Take::kBroken;
  }
  {
    const std::lock_guard lock(mutex_);
    with_driver_[buffer.index] = false;
  }
  const std::size_t used = std::min<std::size_t>(buffer.bytesused, buffers_[buffer.index].size());
  if ((buffer.flags & V4L2_BUF_FLAG_ERROR) != 0 || used == 0 ||
      used < least_bytes(format_, width_, height_, bytes_per_line_)) {
    taken->sequence = buffer.sequence;
    give_back(buffer.index);
    return Take::kFaulty;
  }
  taken->index = buffer.index;
  taken->bytes = buffers_[buffer.index].first(used);
  taken->sequence = buffer.sequence;
  taken->stamp = std::chrono::seconds(buffer.timestamp.tv_sec) + std::chrono::microseconds(buffer.timestamp.tv_usec);
  taken->stamp_is_monotonic = (buffer.flags & V4L2_BUF_FLAG_TIMESTAMP_MASK) == V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
  taken->stamp_at_start = (buffer.flags & V4L2_BUF_FLAG_TSTAMP_SRC_MASK) == V4L2_BUF_FLAG_TSTAMP_SRC_SOE;
  return Take::kFrame;
}

void V4l2Stream::give_back(std::uint32_t index) {
  const std::lock_guard lock(mutex_);
  if (streaming_ && !with_driver_[index]) queue(index);
}

bool V4l2Stream::restart() {
  const std::lock_guard lock(mutex_);
  if (!device_.valid()) return false;
  int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  // What the driver had is back with us after STREAMOFF; what consumers hold they give back themselves.
  const std::vector<bool> had = with_driver_;
  streaming_ = false;
  if (retried_ioctl(fd(), VIDIOC_STREAMOFF, &type) != 0) return false;
  for (std::uint32_t i = 0; i < buffers_.size(); ++i) {
    if (had[i] && !queue(i)) return false;
  }
  streaming_ = retried_ioctl(fd(), VIDIOC_STREAMON, &type) == 0;
  return streaming_;
}

void V4l2Stream::close() {
  const std::lock_guard lock(mutex_);
  if (!device_.valid()) return;
  int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  if (streaming_) retried_ioctl(fd(), VIDIOC_STREAMOFF, &type);
  streaming_ = false;
  device_.reset();
}

}  // namespace vantage
