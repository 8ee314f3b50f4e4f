#pragma once

#include <deque>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "calib/camera_model.h"
#include "drivers/camera/frame_source.h"
#include "onboard/tracking/map_search.h"
#include "onboard/tracking/mapper.h"
#include "onboard/tracking/rotation_alignment.h"
#include "onboard/tracking/sparse_alignment.h"
#include "onboard/tracking/two_view_start.h"

namespace vantage::tracking {

enum class TrackingState {
  kStarting,      ///< there is no map yet
  kTracking,      ///< the pose is good
  kWeak,          ///< there is a pose, from few points; it may soon be lost
  kLost,          ///< this frame has no pose, the one before had
  kRelocalising,  ///< no pose; every frame is compared with the places known
};

const char* name_of(TrackingState state);

struct TrackerOptions {
  MapperOptions mapper;
  StartOptions start;
  MapSearchOptions search;
  AlignmentOptions alignment;
  double scene_distance_m = 1;  ///< of the first points: fixes the scale when nothing else does, else a first guess
  int weak_inliers = 40;        ///< fewer points at their place: weak
  int lost_inliers = 15;        ///< fewer: lost
  double key_frame_parallax = 0.10;  ///< way since the nearest key frame, of the scene's median distance
  double key_frame_turn_rad = 0.20;  ///< turn since then
  double key_frame_overlap = 0.7;    ///< a key frame is due when fewer of the last one's points are seen
  int probation_frames = 25;         ///< a map that is lost earlier, and not found again in ...
  int probation_patience = 8;        ///< ... so many frames, was a bad start: it is undone
  int new_piece_after = 2;           ///< frames without a pose, after which a new piece of map may be begun

  bool valid(std::string* why = nullptr) const;
};

/// What is known of the camera at one frame.
struct TrackingResult {
  TrackingState state = TrackingState::kStarting;
  bool has_pose = false;
  std::uint64_t sequence = 0;
  std::int64_t capture_time_ns = 0;
  Eigen::Isometry3d T_world_camera = Eigen::Isometry3d::Identity();
  /// Of xi, where the true camera is motion_exp(xi) * T_camera_world: metres, then radians, in the camera's frame.
  Matrix6d covariance = Matrix6d::Zero();
  double nearest_distance_m = 0;  ///< to the points seen, 5th percentile
  double median_distance_m = 0;
  int points = 0;            ///< seen at their place
  bool relocalised = false;  ///< found again with this frame
  /// Standard deviation of the unit of length, of itself: how well the robot's kinematics have fixed it so far.
  /// Infinite without them, and while a map is young.
  double unit_sigma = std::numeric_limits<double>::infinity();
  bool began_map = false;    ///< a piece of map began with this frame
  KeyFrameId reference = 0;  ///< the key frame to which the pose is known; corrections of the map move both
  Eigen::Isometry3d T_camera_reference = Eigen::Isometry3d::Identity();
  double reference_scale = 1;  ///< the key frame's at the time: a correction may have changed it since
};

/// Monocular SLAM, semi-direct (Forster et al., "SVO", ICRA 2014), that starts by itself, says when it is lost, and
/// comes back.
///
///     Tracker tracker(camera);
///     const TrackingResult result = tracker.process(frame);
///     if (result.has_pose) use(result.T_world_camera);
///
/// Without a prior the first key frame is the world's origin and the scale is such that the first points are
/// `scene_distance_m` away (median). With priors from the robot's kinematics it starts with the first frame, and world
/// and scale are the robot's. One thread calls process(); with `options.mapper.threaded` a second one maps.
class Tracker {
 public:
  /// \throws std::invalid_argument for a camera or options that are not valid.
  explicit Tracker(const CameraModel& camera, const TrackerOptions& options = {});

  /// The next frame. One of another size than the camera's, or empty, is passed over as one without a pose.
  TrackingResult process(const Frame& frame, const std::optional<PosePrior>& prior = std::nullopt);

  /// Pose of a frame against the map as it is, without changing it: from the pose of a neighbour in time, or from
  /// nothing by relocalisation. For frames that had none when they came.
  TrackingResult locate(const Frame& frame, const TrackingResult* neighbour, const Frame* neighbour_frame);

  /// T_world_camera of an earlier result in the map as it is now. None when its map was undone.
  std::optional<Eigen::Isometry3d> pose_of(const TrackingResult& result);
  /// The piece of map that an earlier result belongs to: results of different pieces have nothing in common.
  int piece_of(const TrackingResult& result);

  /// Key frames that a loop closure has moved since the last call.
  std::vector<CorrectedPose> take_corrections() { return mapper_.take_corrections(); }
  /// Waits for the mapping thread.
  void finish() { mapper_.finish(); }
  const Mapper& mapper() const { return mapper_; }

 private:
  /// The last frame that had a pose.
  struct Last {
    TrackedFrame frame;
    Eigen::Isometry3d T_camera_world;
  };

  void start(const Frame& frame, const std::optional<PosePrior>& prior, TrackingResult* result);
  bool track(const std::shared_ptr<const ImagePyramid>& image, std::int64_t time_ns,
             const std::optional<PosePrior>& prior, TrackedFrame* tracked, TrackingResult* result);
  bool try_relocalise(const std::shared_ptr<const ImagePyramid>& image, TrackedFrame* tracked, TrackingResult* result);
  Eigen::Isometry3d predict(std::int64_t time_ns, const std::optional<PosePrior>& prior) const;
  Eigen::Isometry3d align(const ImagePyramid& image, const Eigen::Isometry3d& T_predicted,
                          const std::optional<PosePrior>& prior, bool* aligned);
  std::vector<KeyFrameId> local_key_frames(const Eigen::Isometry3d& T_camera_world);
  void fill(const MapMatches& matches, const RefinedPose& refined, const Eigen::Isometry3d& T_camera_world,
            TrackedFrame* tracked, TrackingResult* result);
  bool key_frame_due(const TrackedFrame& tracked, const TrackingResult& result);
  void accept(const TrackedFrame& tracked, const TrackingResult& result);
  void settle_in_robot_frame();

  CameraModel camera_;
  TrackerOptions options_;
  PyramidPool pyramids_;
  Mapper mapper_;
  TwoViewStart starter_;
  RotationAlignment rotation_;
  SparseAlignment alignment_;
  MapSearch search_;
  MapMatches matches_;
  std::vector<AlignmentPoint> alignment_points_;

  TrackingState state_ = TrackingState::kStarting;
  std::optional<Last> last_;
  Eigen::Isometry3d velocity_ = Eigen::Isometry3d::Identity();  ///< T_current_last of the last two frames ...
  double velocity_s_ = 0;                                       ///< ... that were so far apart
  int frames_since_start_ = 0;
  int frames_without_pose_ = 0;
  bool robot_ = false;                ///< the map was begun with a prior
  std::deque<TrackingResult> posed_;  ///< the last frames that had a prior ...
  std::deque<PosePrior> priors_;      ///< ... and theirs
  std::size_t frames_since_settled_ = 0;
  double unit_sigma_ = std::numeric_limits<double>::infinity();  ///< of the piece at hand
  int key_frames_asked_for_ = 0;                                 ///< since the start
  std::uint64_t frames_since_key_frame_ = 0;
  Eigen::Isometry3d T_camera_world_key_frame_ = Eigen::Isometry3d::Identity();  ///< of the last one asked for
  std::size_t key_frame_features_ = 0;
};

}  // namespace vantage::tracking
