#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "drivers/camera/frame_source.h"

namespace vantage {

struct ImageFolderOptions {
  std::filesystem::path folder;
  double rate_hz = 30;       ///< where the file names tell no time
  bool in_real_time = true;  ///< else every frame is there at once
};

/// The images of a folder (PNG, JPEG, PGM, BMP, TIFF) in the order of their names, as grey frames.
///
/// Where every name is a number of 16 digits or more, as the recordings of EuRoC have it, the numbers are capture times
/// in nanoseconds; else the frames come at `rate_hz`. The first frame's capture time is the moment it is asked for.
/// Ends after the last one, or at a file that can't be read, which it names.
class ImageFolder final : public FrameSource {
 public:
  /// \throws InputError when the folder is not there or holds no image.
  explicit ImageFolder(const ImageFolderOptions& options);

  FrameStatus next(Frame* frame, std::chrono::milliseconds timeout) override;
  std::string end_reason() const override { return end_reason_; }
  std::size_t size() const { return images_.size(); }

 private:
  struct Image {
    std::filesystem::path path;
    std::chrono::nanoseconds time;  ///< since the first
  };

  ImageFolderOptions options_;
  std::vector<Image> images_;
  std::size_t next_ = 0;
  std::chrono::steady_clock::time_point start_;
  std::string end_reason_;
};

}  // namespace vantage
