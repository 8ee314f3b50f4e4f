#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include <Eigen/Geometry>

namespace vantage {

/// An 8-bit grey image that somebody else's memory holds (a driver's buffer, shared memory).
/// The pixels stay valid, and the buffer is not used again, while a copy of `pixels` lives.
struct GreyImage {
  int width = 0;
  int height = 0;
  std::ptrdiff_t stride = 0;  ///< bytes from one row to the next
  std::shared_ptr<const std::uint8_t> pixels;

  bool empty() const { return pixels == nullptr; }
};

/// One exposure of a camera, or of both cameras of a stereo pair at once.
struct Frame {
  std::int64_t capture_time_ns = 0;  ///< CLOCK_MONOTONIC of the machine that runs the camera, middle of the exposure
  std::uint64_t sequence = 0;        ///< gaps are dropped frames
  double exposure_s = 0;             ///< 0: not known
  int gain = 0;                      ///< in the camera's own steps; 0: not known
  int white_balance_k = 0;           ///< kelvin; 0: not known
  GreyImage image;                   ///< the (left) camera
  GreyImage right_image;             ///< the right camera of a stereo pair; empty for a single camera
  std::optional<Eigen::Isometry3d> T_world_camera;  ///< where whoever carries the camera says it was
};

enum class FrameStatus {
  kFrame,    ///< a frame was delivered
  kTimeout,  ///< none came in time; ask again
  kEnded     ///< no more will come; `end_reason()` says why
};

/// Where frames come from: a V4L2 device, a folder of images, the simulator.
class FrameSource {
 public:
  virtual ~FrameSource() = default;

  /// Waits for the next frame, at most `timeout`. Called by one thread.
  virtual FrameStatus next(Frame* frame, std::chrono::milliseconds timeout) = 0;

  /// Why the source ended, as one line for a person. Empty before.
  virtual std::string end_reason() const = 0;
};

}  // namespace vantage
