#include "onboard/hand_held_camera.h"

#include <chrono>
#include <cmath>
#include <stdexcept>
#include <utility>

#include <spdlog/spdlog.h>

#include "calib/files/input_error.h"
#include "calib/look_at.h"
#include "lcmtypes/link/depth_edges.h"
#include "onboard/depth/cpu_depth_backend.h"

namespace vantage {
namespace {

using tracking::TrackingResult;
using tracking::TrackingState;

constexpr std::chrono::seconds kFirstFramePatience{10};
constexpr std::chrono::milliseconds kFramePatience{200};
constexpr std::size_t kRecentFrames = 1000;  // a key frame ends within 300
constexpr std::uint64_t kPreviewEvery = 30, kCheckEvery = 30;
constexpr double kMovedShare = 0.002, kMovedRad = 0.002;    // corrections by less are not told; of the distance
constexpr double kNearestShare = 0.3, kFarthestShare = 12;  // depths that are possible, of the distance

const HandHeldOptions& checked(const HandHeldOptions& options) {
  if (std::string why; !options.valid(&why)) throw std::invalid_argument("HandHeldCamera: " + why);
  return options;
}

Eigen::Isometry3d first_pose(const HandHeldOptions& options) {
  const Eigen::Vector3d target(0, 0, options.height_m);
  const Eigen::Vector3d back(-std::cos(options.down_rad), 0, std::sin(options.down_rad));
  return look_at(target + options.distance_m * back, target);
}

tracking::TrackerOptions tracker_options(const HandHeldOptions& options) {
  tracking::TrackerOptions tracker;
  tracker.scene_distance_m = options.distance_m;
  tracker.mapper.threaded = !options.every_frame;
  return tracker;
}

DepthFilterOptions filter_options(const HandHeldOptions& options) {
  DepthFilterOptions filter;
  filter.min_depth_m = kNearestShare * options.distance_m;
  filter.max_depth_m = kFarthestShare * options.distance_m;
  filter.converged_relative_sigma = options.sure_share;
  return filter;
}

}  // namespace

bool HandHeldOptions::valid(std::string* why) const {
  const auto fail = [why](const char* reason) {
    if (why != nullptr) *why = reason;
    return false;
  };
  if (!(distance_m > 0) || !std::isfinite(distance_m)) return fail("distance_m must be positive");
  if (!(std::abs(down_rad) <= 1.57)) return fail("down_rad must lie within a right angle");
  if (!std::isfinite(height_m)) return fail("height_m must be finite");
  if (!(sure_share > 0 && sure_share < 1)) return fail("sure_share must lie between 0 and 1");
  if (threads < 0 || most_waiting < 1) return fail("threads must not be negative, most_waiting at least 1");
  return true;
}

HandHeldCamera::HandHeldCamera(FrameSource& source, const Rig& rig, const HandHeldOptions& options)
    : source_(source),
      options_(checked(options)),
      undistorter_(rig.camera),
      T_world_map_(first_pose(options)),
      tracker_(undistorter_.pinhole(), tracker_options(options)),
      pool_(options.threads),
      smoother_(rig.camera.width, rig.camera.height, {}, &pool_),
      watch_(kMovedShare * options.distance_m, kMovedRad) {
  Frame frame;
  if (source_.next(&frame, kFirstFramePatience) != FrameStatus::kFrame) {
    throw InputError("the camera gave no frame" + (source_.end_reason().empty() ? "" : ": " + source_.end_reason()));
  }
  if (frame.image.width != rig.camera.width || frame.image.height != rig.camera.height) {
    throw InputError("the camera's images are " + std::to_string(frame.image.width) + " x " +
                     std::to_string(frame.image.height) + " pixels, the rig's " + std::to_string(rig.camera.width) +
                     " x " + std::to_string(rig.camera.height));
  }
  const CameraModel& camera = undistorter_.pinhole();
  const DepthFilterOptions filter = filter_options(options);
  worker_ = std::make_unique<DepthWorker>(
      std::make_unique<DepthFilter>(camera, filter, KeyFrameOptions{},
                                    std::make_unique<CpuDepthBackend>(camera.width, camera.height, filter, &pool_),
                                    &pool_),
      [this](const DepthFilter& depth, const PosedImage& key) { finish_key_frame(depth, key); });
  snapshot_.T_world_camera = T_world_map_;
  thread_ = std::thread([this, frame = std::move(frame)]() mutable {
    see(std::move(frame));
    run();
  });
}

HandHeldCamera::~HandHeldCamera() {
  stop_ = true;
  thread_.join();
  worker_.reset();
}

void HandHeldCamera::run() {
  while (!stop_) {
    Frame frame;
    const FrameStatus status = source_.next(&frame, kFramePatience);
    if (status == FrameStatus::kFrame) see(std::move(frame));
    if (status != FrameStatus::kEnded) continue;
    worker_->drain();
    const std::lock_guard lock(mutex_);
    snapshot_.activity = RobotActivity::kIdle;
    end_ = {options_.every_frame ? kExitOk : kExitPeerLost, source_.end_reason()};
    return;
  }
}

void HandHeldCamera::see(Frame frame) {
  if (frame.capture_time_ns <= last_time_ns_) return;
  last_time_ns_ = frame.capture_time_ns;
  frame.image = undistorter_.undistort(frame.image);
  const TrackingResult result = tracker_.process(frame);
  // A loop was closed: what was seen before stands elsewhere now.
  const bool moved = !tracker_.take_corrections().empty();
  if (result.has_pose && (!first_ || !tracker_.pose_of(*first_))) first_ = result;  // its start may have been undone
  const bool placed = result.has_pose && result.state == TrackingState::kTracking &&
                      tracker_.piece_of(result) == tracker_.piece_of(*first_);
  note(result);
  {
    const std::lock_guard lock(mutex_);
    if (placed) {
      recent_[frame.capture_time_ns] = result;
      if (recent_.size() > kRecentFrames) recent_.erase(recent_.begin());
      snapshot_.T_world_camera = T_world_map_ * result.T_world_camera;
    }
    snapshot_.activity = placed ? RobotActivity::kCapturing : RobotActivity::kIdle;
    if (frames_since_preview_++ % kPreviewEvery == 0) frame_ = frame;
    if (placed && (moved || ++frames_since_check_ % kCheckEvery == 0)) {
      const std::vector<KeyPose> corrected = watch_.corrections(&tracker_, tracker_.piece_of(*first_), T_world_map_);
      corrections_.insert(corrections_.end(), corrected.begin(), corrected.end());
    }
  }
  if (!placed) return;
  worker_->offer({frame.capture_time_ns, frame.image, T_world_map_ * result.T_world_camera, result.covariance}, moved);
  if (options_.every_frame) worker_->drain();
}

/// Counts, and says when tracking finds or loses its way.
void HandHeldCamera::note(const TrackingResult& result) {
  TrackingState before;
  {
    const std::lock_guard lock(mutex_);
    ++counts_.frames;
    counts_.without_pose += result.has_pose ? 0 : 1;
    counts_.losses += result.state == TrackingState::kLost ? 1 : 0;
    before = std::exchange(state_, result.state);
  }
  const auto sees = [](TrackingState state) {
    return state == TrackingState::kTracking || state == TrackingState::kWeak;
  };
  if (sees(before) != sees(result.state)) spdlog::info("tracking: {}", tracking::name_of(result.state));
}

void HandHeldCamera::finish_key_frame(const DepthFilter& filter, const PosedImage& key) {
  DepthMap map = filter.depth_map();
  smoother_.smooth(key.image, &map);
  mark_depth_edges(&map, {.jump_per_m = DepthEdgeOptions{}.jump_per_m / options_.distance_m,
                          .slope_per_m = DepthEdgeOptions{}.slope_per_m / options_.distance_m});
  const std::lock_guard lock(mutex_);
  const auto result = recent_.find(key.capture_time_ns);
  if (result != recent_.end()) {
    if (const auto T_map_camera = tracker_.pose_of(result->second)) map.T_world_camera = T_world_map_ * *T_map_camera;
    watch_.add(map.utime, result->second, map.T_world_camera);
  }
  ++counts_.depth_maps;
  finished_.push_back(std::move(map));
  if (finished_.size() <= options_.most_waiting) return;
  finished_.pop_front();
  ++counts_.given_up;
}

bool HandHeldCamera::take_goal(const ViewGoal&, std::string* why) {
  *why = "this camera is carried by hand; start vantage-offboard with --no-planning";
  return false;
}

RobotSnapshot HandHeldCamera::snapshot() const {
  const std::lock_guard lock(mutex_);
  return snapshot_;
}

std::optional<DepthMap> HandHeldCamera::fetch_depth_map() {
  const std::lock_guard lock(mutex_);
  if (finished_.empty()) return std::nullopt;
  DepthMap map = std::move(finished_.front());
  finished_.pop_front();
  return map;
}

std::optional<Frame> HandHeldCamera::fetch_frame() {
  const std::lock_guard lock(mutex_);
  return std::exchange(frame_, std::nullopt);
}

std::vector<KeyPose> HandHeldCamera::fetch_corrections() {
  const std::lock_guard lock(mutex_);
  return std::exchange(corrections_, {});
}

/// Not before the last depth map has been fetched.
std::optional<RobotEnd> HandHeldCamera::ended() const {
  const std::lock_guard lock(mutex_);
  return finished_.empty() ? end_ : std::nullopt;
}

HandHeldCamera::Counts HandHeldCamera::counts() const {
  Counts counts;
  {
    const std::lock_guard lock(mutex_);
    counts = counts_;
  }
  counts.passed_over = worker_->passed_over();
  return counts;
}

}  // namespace vantage
