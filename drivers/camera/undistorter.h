#pragma once

#include <memory>

#include "calib/camera_model.h"
#include "drivers/camera/frame_source.h"

namespace vantage {

/// Frees images of a lens's distortion: what a pinhole of the same size, focal lengths and centre would have seen.
/// Bilinear; black where the lens did not look.
class Undistorter {
 public:
  /// \pre `lens` is valid
  explicit Undistorter(const CameraModel& lens);
  ~Undistorter();

  const CameraModel& pinhole() const { return pinhole_; }

  /// A copy in memory of its own, also where there is nothing to mend. \pre the image has the lens's size
  GreyImage undistort(const GreyImage& image) const;

 private:
  struct Maps;

  CameraModel pinhole_;
  std::unique_ptr<const Maps> maps_;  // none for a lens without distortion
};

}  // namespace vantage
