#pragma once

#include <atomic>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "calib/rig.h"
#include "onboard/depth/depth_filter.h"
#include "onboard/depth/huber_tv.h"
#include "onboard/depth/worker_pool.h"
#include "onboard/executive/view_depth.h"
#include "onboard/key_pose_watch.h"
#include "onboard/tracking/tracker.h"

namespace vantage {

struct MonocularDepthOptions {
  /// Of the small motion around a view: a spiral in the image plane, outwards from the view.
  double reach = 0.15;  ///< its radius, of the nearest things' distance: 0.15 is 67 px of parallax at f = 448 px
  double turns = 2.5;   ///< in so many turns
  int frames = 40;      ///< at so many places; fewer when the depth filter has had enough
  double distance_m =
      0.6;  ///< of the nearest things, until the tracker knows better; it is believed from half to twice that
  double unit_share =
      0.005;  ///< the tracker's unit of length must be known to this share of itself for its poses to count
  double moved_m = 0.001, moved_rad = 0.002;  ///< a key frame's correction by less is not told
  double sure_share = 0.010;                  ///< a pixel's depth goes out when its sigma is below this share of it
  int threads = 0;                            ///< of the depth filter; 0: one a core

  bool valid(std::string* why = nullptr) const;
};

/// How the single camera fared so far. Read from any thread.
struct MonocularCounts {
  std::atomic<std::uint64_t> frames{0};        ///< seen, on the way and at views
  std::atomic<std::uint64_t> without_pose{0};  ///< that the tracker could not place
  std::atomic<std::uint64_t> losses{0};
  std::atomic<std::uint64_t> views{0}, views_by_kinematics{0};  ///< measured; of these with the robot's poses alone
};

/// Depth from a single camera: visual tracking on the way and at the view, with the robot's kinematics as its prior,
/// and the dense filter over the frames of a small motion around the view. World and unit of length are the robot's.
///
/// A view is measured with the robot's own poses and their stated noise as long as the tracker's unit of length is not
/// known well, which takes the first views, and when the tracker can't place its key frame. Then the depth filter's
/// pose refinement ties the frames together, and the view's own pose is the mean of what all of them say.
class MonocularDepth final : public ViewDepth {
 public:
  /// \throws std::invalid_argument for options that are not valid or a camera with distortion.
  explicit MonocularDepth(const Rig& rig, const MonocularDepthOptions& options = {});

  bool fits(const Frame& frame, std::string* why) override;
  bool watches_the_way() const override { return true; }
  void pass(const Frame& frame) override { track(frame); }
  void begin(const Frame& key) override;
  std::optional<Eigen::Isometry3d> next_pose() override;
  void add(const Frame& frame) override;
  bool finish(DepthMap* map, std::string* why) override;
  /// As soon as the tracker's unit of length is known, of views that were measured by kinematics, too.
  std::vector<KeyPose> corrections() override;

  const MonocularCounts& counts() const { return counts_; }
  /// Of the last frame.
  tracking::TrackingState tracking_state() const { return state_; }

 private:
  tracking::TrackingResult track(const Frame& frame);
  bool trusts(const tracking::TrackingResult& result) const;
  Eigen::Matrix<double, 6, 6> kinematics_covariance() const;

  Rig rig_;
  MonocularDepthOptions options_;
  tracking::Tracker tracker_;
  WorkerPool pool_;
  DepthFilter filter_;
  HuberTvSmoother smoother_;
  MonocularCounts counts_;
  std::atomic<tracking::TrackingState> state_{tracking::TrackingState::kStarting};
  tracking::TrackingResult last_;
  KeyPoseWatch watch_;

  // Of the view that is being measured.
  Frame key_;
  tracking::TrackingResult key_result_;
  bool key_tracked_ = false;  ///< its pose is the tracker's, and so are the others'
  Eigen::Isometry3d T_world_key_ = Eigen::Isometry3d::Identity();  ///< as the filter has it
  std::vector<Eigen::Isometry3d>
      key_votes_;  ///< T_world_key by each frame's kinematics and its refined place to the key
  FrameUse key_use_ = FrameUse::kNoKeyFrame;
  double radius_m_ = 0;
  int place_ = 0;  ///< of the spiral, the next one
};

}  // namespace vantage
