#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "calib/files/file_descriptor.h"
#include "drivers/camera/capture_clock.h"
#include "drivers/camera/frame_source.h"
#include "drivers/camera/v4l2_stream.h"

namespace vantage {

struct V4l2CameraOptions {
  std::filesystem::path device;  ///< /dev/v4l/by-id/... or /dev/videoN
  StreamOptions stream;
  std::chrono::milliseconds watchdog{1000};  ///< without a frame the stream is restarted
  bool newest_only = true;  ///< a consumer that is slow gets the latest frame; what waited is given back as late

  /// False, with the reason in `why`, when the values make no sense.
  bool valid(std::string* why = nullptr) const;
};

/// What has happened to the frames of a camera.
struct CameraCounters {
  std::uint64_t delivered = 0;
  std::uint64_t copied = 0;    ///< delivered ones that were converted or copied out of the driver's buffer
  std::uint64_t dropped = 0;   ///< gaps in the driver's sequence
  std::uint64_t faulty = 0;    ///< marked by the driver, too short, no JPEG, or with an impossible time stamp
  std::uint64_t late = 0;      ///< a newer one was there already
  std::uint64_t starved = 0;   ///< thrown away because the consumer holds every picture there is
  std::uint64_t restarts = 0;  ///< of the stream: errors and the watchdog
  std::uint64_t reopened = 0;  ///< after the device had gone
};

/// A camera of the kernel (V4L2), as grey frames.
///
/// Pixels lie in the driver's buffer where its format is grey already (GREY, NV12), and the buffer goes back when the
/// last copy of a frame has gone; other formats are converted in one pass. A consumer that holds frames never starves
/// the driver: with less than two buffers left frames are copied.
///
/// The capture time is the middle of the exposure on CLOCK_MONOTONIC, as far as the driver tells the exposure; clocks
/// that disagree are corrected or refused (CaptureClock). `sequence` counts on over restarts and unplugging.
///
/// When the device goes, `next` gives kTimeout until it is back; it is looked for twenty times a second by its stable
/// name and opened anew in full. `stop` may be called from any thread and ends `next` at once.
class V4l2Camera final : public FrameSource {
 public:
  /// \throws InputError when the camera is not there, does not offer the format, size or rate, or is in use;
  /// std::invalid_argument for options that are not valid.
  explicit V4l2Camera(const V4l2CameraOptions& options);
  ~V4l2Camera() override;
  V4l2Camera(const V4l2Camera&) = delete;
  V4l2Camera& operator=(const V4l2Camera&) = delete;

  FrameStatus next(Frame* frame, std::chrono::milliseconds timeout) override;
  std::string end_reason() const override { return end_reason_; }
  /// From any thread: `next` returns kEnded from now on.
  void stop();

  /// Of the thread that calls `next`.
  const CameraCounters& counters() const { return counters_; }
  const CaptureClock& clock() const { return clock_; }
  /// Null while the device is gone.
  const V4l2Stream* stream() const { return stream_.get(); }

 private:
  class PicturePool;
  enum class Wait { kReadable, kTimeout, kStopped };

  Wait wait(std::chrono::steady_clock::time_point until) const;
  bool reopen();
  void lose_device();
  void restart_stream();
  /// Takes the newest frame there is. kTimeout: none.
  FrameStatus take(Frame* frame);
  bool deliver(const V4l2Stream::Buffer& buffer, Frame* frame);
  void count_gap(std::uint32_t sequence);
  FrameStatus end(const std::string& reason);

  V4l2CameraOptions options_;
  FileDescriptor stop_;
  CameraIdentity identity_;
  std::shared_ptr<V4l2Stream> stream_;
  std::shared_ptr<PicturePool> pool_;
  CaptureClock clock_;
  CameraCounters counters_;
  std::optional<std::uint32_t> last_sequence_;  // of the driver, in this stream
  std::uint64_t sequence_ = 0;                  // ours, gaps included
  int restarts_in_a_row_ = 0;
  std::chrono::steady_clock::time_point last_frame_;
  std::string end_reason_;
};

}  // namespace vantage
