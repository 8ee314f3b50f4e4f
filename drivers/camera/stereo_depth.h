#pragma once

#include <memory>
#include <string>

#include "calib/camera_model.h"
#include "drivers/camera/frame_source.h"
#include "lcmtypes/link/depth_map.h"

namespace vantage {

struct StereoDepthOptions {
  int disparities = 144;      ///< px searched; a multiple of 16. The nearest depth is f * baseline / disparities
  int window = 5;             ///< px, odd: side of the matching window
  double sigma_px = 0.3;      ///< standard deviation of a disparity
  double max_depth_m = 3.0;   ///< what lies further is not reported
  double edge_jump_px = 1.5;  ///< disparity step between neighbours, beyond the slope of a surface, that makes an edge
  int edge_radius_px = 3;  ///< pixels around an edge that may carry the other side's depth (half the window, and one)

  /// False, with the reason in `why`, when the values contradict themselves.
  bool valid(std::string* why = nullptr) const;
};

/// Depth from a rectified stereo pair by semi-global block matching (Hirschmueller, PAMI 2008; OpenCV's StereoSGBM).
///
/// Each pixel of the left image gets a depth along z, its standard deviation sigma_z = z^2 sigma_d / (f b), and a
/// state: kConverged, kEdge beside a depth edge (block matching widens the foreground there by half its window), or
/// kInvalid (no unique match, occluded, or outside the range).
class StereoDepth {
 public:
  /// `camera`: both cameras of the pair; `baseline_m`: the right one stands at +x of the left one.
  /// \throws std::invalid_argument for options that are not valid, a camera with distortion or a baseline <= 0.
  StereoDepth(const CameraModel& camera, double baseline_m, const StereoDepthOptions& options = {});
  ~StereoDepth();

  /// Fills `map` but for its ids; the pose is the frame's. False, with the reason in `why` and `map` untouched, when
  /// the frame lacks an image or its pose, or an image is not of the camera's size.
  bool compute(const Frame& frame, DepthMap* map, std::string* why);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace vantage
