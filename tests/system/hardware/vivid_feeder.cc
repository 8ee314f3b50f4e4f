#include "vivid_feeder.h"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <gtest/gtest.h>
#include <linux/videodev2.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/mman.h>

#include "calib/files/file_descriptor.h"

namespace vantage {
namespace {

using std::chrono::milliseconds;

constexpr std::size_t kPixels = std::size_t{kVividWidth} * kVividHeight;

/// The number in its first four pixels, then noise that n decides.
std::vector<std::uint8_t> noise_picture(std::uint32_t n) {
  std::vector<std::uint8_t> grey(kPixels);
  std::uint64_t state = 0x9E3779B97F4A7C15ULL * (n + 1);
  for (std::size_t i = 0; i < kPixels; i += 8) {
    state ^= state << 13, state ^= state >> 7, state ^= state << 17;  // xorshift64
    std::memcpy(&grey[i], &state, 8);
  }
  std::memcpy(grey.data(), &n, sizeof n);
  return grey;
}

std::vector<std::uint8_t> as_yuyv(const std::vector<std::uint8_t>& grey) {
  std::vector<std::uint8_t> yuyv(2 * grey.size());
  for (std::size_t i = 0; i < grey.size(); ++i) {
    yuyv[2 * i] = grey[i];
    yuyv[2 * i + 1] = static_cast<std::uint8_t>(i * 7);
  }
  return yuyv;
}

/// The same with colours that do not matter, half as large as the picture, behind it.
std::vector<std::uint8_t> as_nv12(const std::vector<std::uint8_t>& grey) {
  std::vector<std::uint8_t> nv12 = grey;
  for (std::size_t i = 0; i < grey.size() / 2; ++i) nv12.push_back(static_cast<std::uint8_t>(i * 5));
  return nv12;
}

std::vector<std::uint8_t> in_format(const std::vector<std::uint8_t>& grey, std::uint32_t fourcc) {
  if (fourcc == V4L2_PIX_FMT_YUYV) return as_yuyv(grey);
  return fourcc == V4L2_PIX_FMT_NV12 ? as_nv12(grey) : grey;
}

/// The output node, streaming from mapped buffers: shows one picture a frame.
class OutputStream {
 public:
  /// Nothing when the node is not there or does not take the format.
  static std::unique_ptr<OutputStream> open(std::uint32_t fourcc) {
    std::unique_ptr<OutputStream> stream(new OutputStream);
    return stream->start(fourcc) ? std::move(stream) : nullptr;
  }
  ~OutputStream() {
    for (const std::span<std::uint8_t> buffer : buffers_) ::munmap(buffer.data(), buffer.size());
  }
  OutputStream(const OutputStream&) = delete;
  OutputStream& operator=(const OutputStream&) = delete;

  /// Waits for a free buffer, at most 100 ms, and has the picture shown. False when the node is gone.
  bool show(const std::vector<std::uint8_t>& bytes) {
    v4l2_buffer buffer = empty();
    if (filled_ < buffers_.size()) {
      buffer.index = static_cast<std::uint32_t>(filled_++);
    } else {
      pollfd polled{node_.get(), POLLOUT, 0};
      ::poll(&polled, 1, 100);
      if (::ioctl(node_.get(), VIDIOC_DQBUF, &buffer) != 0) return errno == EAGAIN;
      buffer = empty(buffer.index);
    }
    std::copy(bytes.begin(), bytes.end(), buffers_[buffer.index].begin());
    buffer.bytesused = static_cast<std::uint32_t>(bytes.size());
    buffer.field = V4L2_FIELD_NONE;
    return ::ioctl(node_.get(), VIDIOC_QBUF, &buffer) == 0;
  }

 private:
  OutputStream() = default;

  static v4l2_buffer empty(std::uint32_t index = 0) {
    v4l2_buffer buffer{};
    buffer.type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
    buffer.memory = V4L2_MEMORY_MMAP;
    buffer.index = index;
    return buffer;
  }

  bool start(std::uint32_t fourcc) {
    node_ = FileDescriptor(::open("/dev/video1", O_RDWR | O_NONBLOCK | O_CLOEXEC));
    v4l2_format format{};
    format.type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
    format.fmt.pix.width = kVividWidth;
    format.fmt.pix.height = kVividHeight;
    format.fmt.pix.pixelformat = fourcc;
    format.fmt.pix.field = V4L2_FIELD_NONE;
    v4l2_requestbuffers request{};
    request.count = 4;
    request.type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
    request.memory = V4L2_MEMORY_MMAP;
    if (!node_.valid() || ::ioctl(node_.get(), VIDIOC_S_FMT, &format) != 0 ||
        ::ioctl(node_.get(), VIDIOC_REQBUFS, &request) != 0) {
      return false;
    }
    for (std::uint32_t i = 0; i < request.count; ++i) {
      v4l2_buffer buffer = empty(i);
      if (::ioctl(node_.get(), VIDIOC_QUERYBUF, &buffer) != 0) return false;
      void* memory = ::mmap(nullptr, buffer.length, PROT_READ | PROT_WRITE, MAP_SHARED, node_.get(), buffer.m.offset);
      if (memory == MAP_FAILED) return false;
      buffers_.emplace_back(static_cast<std::uint8_t*>(memory), buffer.length);
    }
    int type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
    return ::ioctl(node_.get(), VIDIOC_STREAMON, &type) == 0;
  }

  FileDescriptor node_;
  std::vector<std::span<std::uint8_t>> buffers_;
  std::size_t filled_ = 0;
};

}  // namespace

VividFeeder::VividFeeder(std::uint32_t fourcc, Picture picture)
    : fourcc_(fourcc), picture_(picture ? std::move(picture) : noise_picture) {
  thread_ = std::thread([this] { run(); });
  for (int i = 0; i < 500 && written_ < 6; ++i) std::this_thread::sleep_for(milliseconds(10));
  EXPECT_GE(written_, 6) << "nothing is shown";
}

VividFeeder::~VividFeeder() {
  stop_ = true;
  thread_.join();
}

void VividFeeder::run() {
  std::uint32_t n = 0;
  std::unique_ptr<OutputStream> output;
  while (!stop_) {
    if (output == nullptr) output = OutputStream::open(fourcc_);
    if (output == nullptr) {
      std::this_thread::sleep_for(milliseconds(20));
      continue;
    }
    const std::vector<std::uint8_t> grey = picture_(n++);
    if (output->show(in_format(grey, fourcc_))) {
      ++written_;
    } else {
      output.reset();
    }
  }
}

std::int64_t vivid_picture_number(const GreyImage& image) {
  std::uint32_t n = 0;
  std::memcpy(&n, image.pixels.get(), sizeof n);
  const std::vector<std::uint8_t> expected = noise_picture(n);
  for (int y = 0; y < kVividHeight; ++y) {
    if (std::memcmp(image.pixels.get() + y * image.stride, &expected[static_cast<std::size_t>(y) * kVividWidth],
                    kVividWidth) != 0) {
      return -1;
    }
  }
  return n;
}

}  // namespace vantage
