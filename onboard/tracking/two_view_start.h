#pragma once

#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "calib/camera_model.h"
#include "onboard/tracking/corner_detector.h"
#include "onboard/tracking/image_pyramid.h"
#include "onboard/tracking/rotation_alignment.h"

namespace vantage::tracking {

struct StartOptions {
  double least_disparity_px = 10;  ///< median, before a start is tried
  double least_parallax_px = 15;   ///< median angle between a point's two rays, times the focal length, after it
  double least_turned_px = 1;      ///< median disparity that the best turn alone leaves: less is no parallax but noise
  int least_points = 40;
  double error_px = 2;       ///< a point that two poses explain reprojects within this
  double least_share = 0.6;  ///< of the tracks must agree with the start
  int frames_between = 8;    ///< that must agree as well
  bool valid(std::string* why = nullptr) const;
};

/// A frame on the way to a start.
struct StartFrame {
  std::uint64_t sequence = 0;
  std::int64_t capture_time_ns = 0;
  std::shared_ptr<const ImagePyramid> image;
};

/// A corner of the first frame, its place in the last, and its position in the first camera's frame.
struct StartPoint {
  Corner corner;
  Eigen::Vector2d pixel{0, 0};
  Eigen::Vector3d position{0, 0, 0};
};

/// Two posed frames and the points they see. The distance between them is 1.
struct Start {
  StartFrame first, last;
  Eigen::Isometry3d T_last_first = Eigen::Isometry3d::Identity();
  std::vector<StartPoint> points;
  double rms_px = 0;
  double parallax_rad = 0;  ///< median
};

/// Start of a map from two views and those between.
///
/// Corners of a first frame are followed (their patch of the first frame, coarse to fine) until they have moved far
/// enough. A homography and an essential matrix are estimated; every motion that either allows is judged by the points
/// that it explains in front of both cameras, and the best few by the frames between as well, which two views that fit
/// a wrong motion by chance do not. The winner is adjusted over all these frames and refused when it does not fit.
/// Source: Mur-Artal et al. 2015 (two models); Forster et al. 2014 (tracks).
class TwoViewStart {
 public:
  TwoViewStart(const CameraModel& camera, const StartOptions& options = {});

  /// The next frame. A start when there is one. Begins anew from this frame when too few corners are left.
  std::optional<Start> add(const StartFrame& frame);
  void reset();

  double disparity_px() const { return disparity_px_; }  ///< median of the tracks

 private:
  struct Track {
    Corner corner;
    Eigen::Vector2d pixel;
    bool lost = false;
  };
  struct Between {
    std::vector<Eigen::Vector2d> pixels;  // of every track, NaN where it was lost
  };

  void begin(const StartFrame& frame);
  bool follow(const ImagePyramid& image, Track* track, const Eigen::Vector2d& expected) const;
  std::optional<Start> solve(const StartFrame& frame) const;

  CameraModel camera_;
  StartOptions options_;
  RotationAlignment rotation_;
  std::optional<StartFrame> first_;
  std::shared_ptr<const ImagePyramid> previous_;
  std::vector<Track> tracks_;
  std::vector<Between> between_;
  std::size_t initial_tracks_ = 0;
  double disparity_px_ = 0;
};

}  // namespace vantage::tracking
