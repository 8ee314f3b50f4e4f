#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <thread>
#include <vector>

#include "drivers/camera/frame_source.h"

namespace vantage {

// The kernel's test driver vivid: its capture node /dev/video0 gives what is written to its output node /dev/video1.

inline constexpr int kVividWidth = 640, kVividHeight = 480;

/// Writes numbered pictures to the output node in a pixel format (V4L2_PIX_FMT_GREY, _YUYV or _NV12), at its
/// rate, in a thread of its own. Survives that the node goes and comes back.
class VividFeeder {
 public:
  /// Grey picture number n, kVividWidth x kVividHeight, row-major.
  using Picture = std::function<std::vector<std::uint8_t>(std::uint32_t n)>;

  /// Shows noise of which vivid_picture_number tells the number, or `picture`. Returns when the first pictures are
  /// shown; a failure of the test where none is within 5 s.
  explicit VividFeeder(std::uint32_t fourcc, Picture picture = {});
  ~VividFeeder();
  VividFeeder(const VividFeeder&) = delete;
  VividFeeder& operator=(const VividFeeder&) = delete;

 private:
  void run();

  std::uint32_t fourcc_;
  Picture picture_;
  std::atomic<bool> stop_{false};
  std::atomic<int> written_{0};
  std::thread thread_;
};

/// The number of the noise picture that a frame shows to the last bit; -1 when it shows none of a feeder's.
std::int64_t vivid_picture_number(const GreyImage& image);

}  // namespace vantage
