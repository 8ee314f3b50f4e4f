#include "onboard/monocular_depth.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <stdexcept>

#include "lcmtypes/link/depth_edges.h"
#include "onboard/depth/cpu_depth_backend.h"

namespace vantage {
namespace {

constexpr double kLeastShiftShare = 0.002, kLeastTurn_rad = 0.001;

const MonocularDepthOptions& checked(const MonocularDepthOptions& options) {
  if (std::string why; !options.valid(&why)) throw std::invalid_argument("MonocularDepth: " + why);
  return options;
}

tracking::TrackerOptions tracker_options(const MonocularDepthOptions& options) {
  tracking::TrackerOptions tracker;
  tracker.scene_distance_m = options.distance_m;
  return tracker;
}

DepthFilterOptions filter_options(const MonocularDepthOptions& options) {
  DepthFilterOptions filter;
  filter.converged_relative_sigma = options.sure_share;
  return filter;
}

/// The tracker's covariance knows the noise of its points alone: with the map's own errors it is no less than this. The
/// depth filter takes it for an upper bound and judges what there really is.
Eigen::Matrix<double, 6, 6> tracked_covariance(const tracking::TrackingResult& result) {
  const double shift_m = kLeastShiftShare * result.median_distance_m;
  Eigen::Matrix<double, 6, 6> covariance = result.covariance;
  covariance.diagonal().head<3>().array() += shift_m * shift_m;
  covariance.diagonal().tail<3>().array() += kLeastTurn_rad * kLeastTurn_rad;
  return covariance;
}

/// Mean of poses that differ little.
Eigen::Isometry3d mean_of(const std::vector<Eigen::Isometry3d>& poses) {
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
  Eigen::Vector4d rotation = Eigen::Vector4d::Zero();
  const Eigen::Quaterniond first(poses.front().linear());
  for (const Eigen::Isometry3d& pose : poses) {
    translation += pose.translation();
    const Eigen::Quaterniond q(pose.linear());
    rotation += q.dot(first) < 0 ? Eigen::Vector4d(-q.coeffs()) : q.coeffs();
  }
  Eigen::Isometry3d mean = Eigen::Isometry3d::Identity();
  mean.linear() = Eigen::Quaterniond(rotation.normalized()).toRotationMatrix();
  mean.translation() = translation / static_cast<double>(poses.size());
  return mean;
}

}  // namespace

bool MonocularDepthOptions::valid(std::string* why) const {
  const auto fail = [why](const char* reason) {
    if (why != nullptr) *why = reason;
    return false;
  };
  if (!(reach > 0 && reach < 1)) return fail("reach must lie between 0 and 1");
  if (!(turns > 0) || frames < 2) return fail("turns must be positive, frames at least 2");
  if (!(distance_m > 0)) return fail("distance_m must be positive");
  if (!(sure_share > 0 && sure_share < 1)) return fail("sure_share must lie between 0 and 1");
  if (!(moved_m >= 0 && moved_rad >= 0)) return fail("moved_m and moved_rad must not be negative");
  if (!(unit_share > 0)) return fail("unit_share must be positive");
  if (threads < 0) return fail("threads must not be negative");
  return true;
}

MonocularDepth::MonocularDepth(const Rig& rig, const MonocularDepthOptions& options)
    : rig_(rig),
      options_(checked(options)),
      tracker_(rig.camera, tracker_options(options)),
      pool_(options.threads),
      filter_(rig.camera, filter_options(options), {},
              std::make_unique<CpuDepthBackend>(rig.camera.width, rig.camera.height, filter_options(options), &pool_),
              &pool_),
      smoother_(rig.camera.width, rig.camera.height, {}, &pool_),
      watch_(options.moved_m, options.moved_rad) {}

bool MonocularDepth::fits(const Frame& frame, std::string* why) {
  if (frame.image.width != rig_.camera.width || frame.image.height != rig_.camera.height) {
    *why = "an image is " + std::to_string(frame.image.width) + " x " + std::to_string(frame.image.height) +
           " pixels, the rig's camera " + std::to_string(rig_.camera.width) + " x " +
           std::to_string(rig_.camera.height);
    return false;
  }
  if (!frame.T_world_camera || !is_rigid(*frame.T_world_camera)) return *why = "the frame's pose is not known", false;
  return true;
}

Eigen::Matrix<double, 6, 6> MonocularDepth::kinematics_covariance() const {
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  covariance.diagonal().head<3>().setConstant(rig_.kinematics_sigma_m * rig_.kinematics_sigma_m);
  covariance.diagonal().tail<3>().setConstant(rig_.kinematics_sigma_rad * rig_.kinematics_sigma_rad);
  return covariance;
}

tracking::TrackingResult MonocularDepth::track(const Frame& frame) {
  std::optional<tracking::PosePrior> prior;
  if (frame.T_world_camera) prior = {*frame.T_world_camera, rig_.kinematics_sigma_m, rig_.kinematics_sigma_rad};
  const tracking::TrackingResult result = tracker_.process(frame, prior);
  last_ = result;
  state_ = result.state;
  ++counts_.frames;
  counts_.without_pose += result.has_pose ? 0 : 1;
  counts_.losses += result.state == tracking::TrackingState::kLost ? 1 : 0;
  return result;
}

bool MonocularDepth::trusts(const tracking::TrackingResult& result) const {
  return result.has_pose && result.unit_sigma < options_.unit_share;
}

void MonocularDepth::begin(const Frame& key) {
  key_ = key;
  key_result_ = track(key);
  key_tracked_ = trusts(key_result_);
  T_world_key_ = key_tracked_ ? key_result_.T_world_camera : key.T_world_camera.value_or(Eigen::Isometry3d::Identity());
  key_use_ = filter_.start({key.capture_time_ns, key.image, T_world_key_,
                            key_tracked_ ? tracked_covariance(key_result_) : kinematics_covariance()});
  // What is near is what is looked at; of the room behind it there may be more points.
  const double nearest_m =
      key_tracked_ && key_result_.nearest_distance_m > 0 ? key_result_.nearest_distance_m : options_.distance_m;
  radius_m_ = options_.reach * std::clamp(nearest_m, options_.distance_m / 2, 2 * options_.distance_m);
  place_ = 0;
  key_votes_ = {T_world_key_};
}

std::optional<Eigen::Isometry3d> MonocularDepth::next_pose() {
  if (key_use_ != FrameUse::kUsed || !key_.T_world_camera || place_ == options_.frames ||
      filter_.key_frame_end() != KeyFrameEnd::kNotYet) {
    return {};
  }
  const double way = static_cast<double>(++place_) / options_.frames;
  const double angle = 2 * std::numbers::pi * options_.turns * way, radius = radius_m_ * way;
  return *key_.T_world_camera * Eigen::Translation3d(radius * std::cos(angle), radius * std::sin(angle), 0);
}

void MonocularDepth::add(const Frame& frame) {
  const tracking::TrackingResult result = track(frame);
  if (!key_tracked_) {
    if (frame.T_world_camera && filter_.update({frame.capture_time_ns, frame.image, *frame.T_world_camera,
                                                kinematics_covariance()}) == FrameUse::kUsed) {
      key_votes_.push_back(*frame.T_world_camera * filter_.T_frame_key());
    }
    return;
  }
  if (!result.has_pose || tracker_.piece_of(result) != tracker_.piece_of(key_result_)) return;
  // The map may have been moved as a whole since the key frame: what counts is the frame's place relative to it.
  const std::optional<Eigen::Isometry3d> T_world_key = tracker_.pose_of(key_result_);
  if (!T_world_key) return;
  filter_.update({frame.capture_time_ns, frame.image, T_world_key_ * T_world_key->inverse() * result.T_world_camera,
                  tracked_covariance(result)});
}

bool MonocularDepth::finish(DepthMap* map, std::string* why) {
  if (key_use_ != FrameUse::kUsed) return *why = "the key frame has no pose, or another size than the rig's", false;
  *map = filter_.depth_map();
  smoother_.smooth(key_.image, map);
  mark_depth_edges(map, {});
  map->T_world_camera = key_tracked_ ? tracker_.pose_of(key_result_).value_or(T_world_key_) : mean_of(key_votes_);
  ++counts_.views;
  counts_.views_by_kinematics += key_tracked_ ? 0 : 1;
  if (key_result_.has_pose) watch_.add(map->utime, key_result_, map->T_world_camera);
  key_ = {};
  return true;
}

std::vector<KeyPose> MonocularDepth::corrections() {
  if (!trusts(last_)) return {};
  return watch_.corrections(&tracker_, tracker_.piece_of(last_), Eigen::Isometry3d::Identity());
}

}  // namespace vantage
