#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "calib/rig.h"
#include "drivers/camera/frame_source.h"
#include "drivers/camera/undistorter.h"
#include "onboard/depth/depth_worker.h"
#include "onboard/depth/huber_tv.h"
#include "onboard/depth/worker_pool.h"
#include "onboard/executive/robot_body.h"
#include "onboard/key_pose_watch.h"
#include "onboard/tracking/tracker.h"

namespace vantage {

struct HandHeldOptions {
  /// What images can't tell: how large the world is, and which way is down. The first view looks from -x, upright,
  /// `down_rad` below the horizon, at the point (0, 0, height_m) of the world, `distance_m` away.
  double distance_m = 0.7;
  double down_rad = 0.5;
  double height_m = 0.1;
  double sure_share = 0.015;     ///< a pixel's depth goes out when its sigma is below this share of it
  int threads = 0;               ///< of the depth filter; 0: one a core
  bool every_frame = false;      ///< wait for the depth filter instead of leaving frames out: for recordings
  std::size_t most_waiting = 4;  ///< depth maps that nobody fetches; the oldest leaves

  bool valid(std::string* why = nullptr) const;
};

/// A camera in somebody's hand: tracking and dense depth of one key frame after another. No goal can be asked of it.
///
/// One thread takes frames and tracks, one filters depth; they share the tracker's map under its own lock. Frames that
/// tracking can't place in the piece of map it began with are left out of the depth.
class HandHeldCamera final : public RobotBody {
 public:
  /// What came of the frames so far.
  struct Counts {
    std::uint64_t frames = 0, without_pose = 0, losses = 0;
    std::uint64_t depth_maps = 0;
    std::uint64_t passed_over = 0;  ///< frames that came while the depth filter was busy
    std::uint64_t given_up = 0;     ///< depth maps that nobody fetched
  };

  /// `source` must outlive it. \throws InputError when there is no frame or it is not of the rig's size,
  /// std::invalid_argument for options that are not valid.
  HandHeldCamera(FrameSource& source, const Rig& rig, const HandHeldOptions& options = {});
  ~HandHeldCamera() override;

  bool take_goal(const ViewGoal& goal, std::string* why) override;
  void hold() override {}
  RobotSnapshot snapshot() const override;
  std::optional<DepthMap> fetch_depth_map() override;
  std::optional<Frame> fetch_frame() override;
  std::vector<KeyPose> fetch_corrections() override;
  /// When the source has ended: well for a recording, else not.
  std::optional<RobotEnd> ended() const override;

  Counts counts() const;

 private:
  void run();
  void see(Frame frame);
  void note(const tracking::TrackingResult& result);
  void finish_key_frame(const DepthFilter& filter, const PosedImage& key);

  FrameSource& source_;
  HandHeldOptions options_;
  Undistorter undistorter_;
  Eigen::Isometry3d T_world_map_;  ///< from tracking's world, the first camera's, to the robot's
  tracking::Tracker tracker_;
  WorkerPool pool_;
  HuberTvSmoother smoother_;

  // Of the tracking thread.
  std::optional<tracking::TrackingResult> first_;  ///< of the piece of map that the world is
  std::int64_t last_time_ns_ = 0;
  std::uint64_t frames_since_preview_ = 0, frames_since_check_ = 0;

  mutable std::mutex mutex_;                                 // guards what follows, up to the next comment
  std::map<std::int64_t, tracking::TrackingResult> recent_;  ///< by capture time; a key frame is looked up here
  KeyPoseWatch watch_;
  std::deque<DepthMap> finished_;
  std::optional<Frame> frame_;
  std::vector<KeyPose> corrections_;
  RobotSnapshot snapshot_;
  tracking::TrackingState state_ = tracking::TrackingState::kStarting;
  std::optional<RobotEnd> end_;
  Counts counts_;

  std::atomic<bool> stop_{false};
  std::unique_ptr<DepthWorker> worker_;
  std::thread thread_;
};

}  // namespace vantage
