#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include "calib/files/file_descriptor.h"
#include "drivers/camera/grey_conversion.h"
#include "drivers/camera/v4l2_controls.h"
#include "drivers/camera/v4l2_device.h"

namespace vantage {

struct StreamOptions {
  int width = 0, height = 0;
  double rate_hz = 30;
  std::string format;  ///< four characters, e.g. YUYV; empty: the best that the camera offers
  int buffers = 6;
  CameraSettings settings;
};

/// An opened camera that streams into mapped buffers: one life of it, from opening to closing.
///
/// `take` belongs to one thread, `give_back` to any. The mapped memory lives as long as a shared pointer to the stream.
class V4l2Stream {
 public:
  enum class Take {
    kFrame,
    kNothing,  ///< none is ready
    kFaulty,   ///< a frame that the driver marks as damaged, or that is too short; given back already
    kBroken,   ///< EIO and the like: the stream has to be restarted
    kGone      ///< the device does not exist any more
  };
  struct Buffer {
    std::uint32_t index = 0;
    std::span<const std::uint8_t> bytes;
    std::uint32_t sequence = 0;
    std::chrono::nanoseconds stamp{0};
    bool stamp_is_monotonic = false;
    bool stamp_at_start = false;  ///< of the exposure's start, else of its end
  };

  /// Opens, sets format, rate and controls, maps, starts. Null, with the reason and its mend in `why`.
  static std::shared_ptr<V4l2Stream> open(const std::filesystem::path& node, const StreamOptions& options,
                                          std::string* why);
  ~V4l2Stream();
  V4l2Stream(const V4l2Stream&) = delete;
  V4l2Stream& operator=(const V4l2Stream&) = delete;

  int fd() const { return device_.get(); }
  Take take(Buffer* buffer);
  void give_back(std::uint32_t index);
  /// Stops and starts again; what consumers hold comes back later. False when the driver refuses.
  bool restart();
  /// Stops and closes; mapped memory that consumers hold stays readable.
  void close();

  PixelFormat format() const { return format_; }
  std::uint32_t fourcc() const { return fourcc_; }
  std::size_t bytes_per_line() const { return bytes_per_line_; }
  double rate_hz() const { return rate_hz_; }  ///< as the driver keeps it
  const FixedSettings& settings() const { return settings_; }
  const CameraIdentity& identity() const { return identity_; }
  int width() const { return width_; }
  int height() const { return height_; }
  /// Buffers that the driver can fill.
  int queued() const;

 private:
  V4l2Stream() = default;
  bool set_format(const StreamOptions& options, std::string* why);
  bool map_buffers(int count, std::string* why);
  bool queue(std::uint32_t index);
  bool start();

  FileDescriptor device_;
  CameraIdentity identity_;
  PixelFormat format_ = PixelFormat::kGrey;
  std::uint32_t fourcc_ = 0;
  int width_ = 0, height_ = 0;
  std::size_t bytes_per_line_ = 0;
  double rate_hz_ = 0;
  FixedSettings settings_;
  std::vector<std::span<std::uint8_t>> buffers_;

  mutable std::mutex mutex_;  // guards the two below, and that the device is open while a buffer is queued
  bool streaming_ = false;
  std::vector<bool> with_driver_;
};

}  // namespace vantage
