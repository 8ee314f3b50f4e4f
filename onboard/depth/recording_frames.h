#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <vector>

#include "calib/camera_model.h"
#include "calib/files/trajectory.h"
#include "drivers/camera/undistorter.h"
#include "onboard/depth/depth_filter.h"

namespace vantage {

/// The images of a recording in TUM layout that have a pose (groundtruth.txt or trajectory.txt), read when they are
/// asked for and freed of the lens's distortion.
class RecordingFrames {
 public:
  /// Reads camera.yaml, rgb.txt and the poses. \throws InputError that names the file and the line.
  explicit RecordingFrames(const std::filesystem::path& folder);
  ~RecordingFrames();

  int size() const { return static_cast<int>(images_.size()); }  ///< lines of rgb.txt
  const CameraModel& camera() const { return pinhole_; }         ///< of the images as they are given out

  double depth_unit_m() const { return depth_unit_m_; }  ///< of the recording's 16-bit depth images

  /// Image `index` of rgb.txt, grey, with its pose; none when no pose is within 20 ms.
  /// \throws InputError when the image can't be read or has another size than the first.
  std::optional<PosedImage> frame(int index) const;

  /// True depth (m, along z; 0: none) of image `index`, when depth.txt has one within 20 ms. Empty otherwise.
  std::vector<float> true_depth(int index) const;

 private:
  std::filesystem::path folder_;
  std::vector<StampedFile> images_, depths_;
  std::vector<StampedPose> poses_;
  CameraModel pinhole_;
  double depth_unit_m_ = 0.001;
  std::unique_ptr<const Undistorter> undistorter_;
};

}  // namespace vantage
