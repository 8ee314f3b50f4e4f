#include "onboard/depth/depth_filter.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace vantage {
namespace {

using Matrix6d = Eigen::Matrix<double, 6, 6>;

/// Moves a perturbation (shift, turn) from before T to after it: T exp(d) = exp(adjoint(T) d) T.
Matrix6d adjoint(const Eigen::Isometry3d& T) {
  const Eigen::Matrix3d R = T.rotation();
  const Eigen::Vector3d t = T.translation();
  Eigen::Matrix3d cross;
  cross << 0, -t.z(), t.y(), t.z(), 0, -t.x(), -t.y(), t.x(), 0;
  Matrix6d result = Matrix6d::Zero();
  result.topLeftCorner<3, 3>() = R;
  result.bottomRightCorner<3, 3>() = R;
  result.topRightCorner<3, 3>() = cross * R;
  return result;
}

PairGeometry pair_geometry(const CameraModel& camera, const Eigen::Isometry3d& T_frame_key, const Matrix6d& covariance,
                           double misfit_px) {
  PairGeometry pair;
  pair.misfit_variance_px2 = static_cast<float>(misfit_px * misfit_px);
  pair.fx = static_cast<float>(camera.fx);
  pair.fy = static_cast<float>(camera.fy);
  pair.cx = static_cast<float>(camera.cx);
  pair.cy = static_cast<float>(camera.cy);
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) pair.rotation[3 * i + k] = static_cast<float>(T_frame_key.linear()(i, k));
    pair.translation[i] = static_cast<float>(T_frame_key.translation()(i));
  }
  for (int i = 0; i < 6; ++i) {
    for (int k = 0; k < 6; ++k) pair.covariance[6 * i + k] = static_cast<float>(covariance(i, k));
  }
  return pair;
}

PixelBelief prior_belief(const DepthFilterOptions& options) {
  // The Gaussian that stands for "anywhere in the range": three sigmas to either side of the middle reach past both
  // ends.
  const double nearest = 1 / options.min_depth_m, farthest = 1 / options.max_depth_m;
  const double sigma = (nearest - farthest) / 4;
  return {.mean = static_cast<float>(0.5 * (nearest + farthest)),
          .variance = static_cast<float>(sigma * sigma),
          .inliers = static_cast<float>(options.prior_inliers),
          .outliers = static_cast<float>(options.prior_outliers)};
}

}  // namespace

DepthFilter::DepthFilter(const CameraModel& camera, const DepthFilterOptions& options,
                         const KeyFrameOptions& key_frames, std::unique_ptr<DepthBackend> backend, WorkerPool* pool)
    : camera_(camera), options_(options), backend_(std::move(backend)), policy_(key_frames) {
  std::string why;
  if (!camera.valid(&why) || !options.valid(&why) || !key_frames.valid(&why)) {
    throw std::invalid_argument("DepthFilter: " + why);
  }
  if (camera.distortion != Distortion::kNone) throw std::invalid_argument("DepthFilter: undistort the images first");
  if (options.refine_poses) refinement_ = std::make_unique<PoseRefinement>(camera, options, pool);
  beliefs_.resize(static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height));
}

DepthFilter::~DepthFilter() = default;

FrameUse DepthFilter::check(const PosedImage& frame) const {
  if (frame.image.empty() || frame.image.width != camera_.width || frame.image.height != camera_.height) {
    return FrameUse::kWrongSize;
  }
  if (!is_rigid(frame.T_world_camera) || !frame.covariance.allFinite() ||
      (frame.covariance.diagonal().array() < 0).any()) {
    return FrameUse::kBadPose;
  }
  if (key_ && frame.capture_time_ns <= last_time_ns_) return FrameUse::kOutOfOrder;
  return FrameUse::kUsed;
}

void DepthFilter::begin(const PosedImage& key_frame, double scale_sigma) {
  backend_->start(key_frame.image, beliefs_);
  if (refinement_) refinement_->begin(key_frame.image, key_frame.covariance, beliefs_, scale_sigma);
  policy_.begin();
  key_ = key_frame;
  last_time_ns_ = key_frame.capture_time_ns;
  T_frame_key_.setIdentity();
  counts_ = {};
  frames_ = 0;
}

FrameUse DepthFilter::start(const PosedImage& key_frame) {
  if (const FrameUse use = check(key_frame); use != FrameUse::kUsed) {
    ++refused_;
    return use;
  }
  std::fill(beliefs_.begin(), beliefs_.end(), prior_belief(options_));
  begin(key_frame, 0);
  return FrameUse::kUsed;
}

FrameUse DepthFilter::advance(const PosedImage& key_frame) {
  if (!key_) return start(key_frame);
  const bool just_used = key_frame.capture_time_ns == last_time_ns_ && frames_ > 0;
  const std::int64_t last_time_ns = last_time_ns_;
  if (just_used) --last_time_ns_;
  const FrameUse use = check(key_frame);
  last_time_ns_ = last_time_ns;
  if (use != FrameUse::kUsed) {
    ++refused_;
    return use;
  }
  const double scale = refinement_ ? refinement_->scale() : 1;
  const double scale_sigma = refinement_ ? refinement_->scale_sigma() : 0;
  Eigen::Isometry3d T_new_key = T_frame_key_;
  if (!just_used) {
    T_new_key = key_frame.T_world_camera.inverse() * key_->T_world_camera;
    T_new_key.translation() /= scale;
  }
  carry(T_new_key, scale);
  begin(key_frame, scale_sigma / scale);
  return FrameUse::kUsed;
}

/// Fills beliefs_, in metres, with those of the present key frame as the new one sees them: the nearest where several
/// fall on a pixel, the prior where none does.
void DepthFilter::carry(const Eigen::Isometry3d& T_new_key, double scale) {
  // What a carried belief loses: its place is a rounded pixel, and its matches were of another patch.
  constexpr double kInflation = 4, kRelativeSigma = 0.01;
  std::vector<PixelBelief> old;
  std::vector<PixelState> states;
  read(&old, &states);
  const PixelBelief prior = prior_belief(options_);
  std::fill(beliefs_.begin(), beliefs_.end(), prior);
  const double nearest = 1 / options_.min_depth_m, farthest = 1 / options_.max_depth_m;
  for (int y = 0; y < camera_.height; ++y) {
    for (int x = 0; x < camera_.width; ++x) {
      const std::size_t i =
          static_cast<std::size_t>(y) * static_cast<std::size_t>(camera_.width) + static_cast<std::size_t>(x);
      if (states[i] != PixelState::kConverged) continue;
      const Eigen::Vector3d ray((x - camera_.cx) / camera_.fx, (y - camera_.cy) / camera_.fy, 1);
      const Eigen::Vector3d turned = T_new_key.linear() * ray;
      const Eigen::Vector3d P = turned + static_cast<double>(old[i].mean) * T_new_key.translation();
      if (P.z() <= 0.05) continue;
      const double u = std::round(camera_.fx * P.x() / P.z() + camera_.cx);
      const double v = std::round(camera_.fy * P.y() / P.z() + camera_.cy);
      if (!(u >= 0 && v >= 0 && u < camera_.width && v < camera_.height)) continue;
      PixelBelief& belief =
          beliefs_[static_cast<std::size_t>(v) * static_cast<std::size_t>(camera_.width) + static_cast<std::size_t>(u)];
      const double inverse = old[i].mean / P.z() / scale;
      if (inverse > nearest || inverse < farthest) continue;
      const bool taken = belief.variance < prior.variance;
      if (taken && inverse <= belief.mean) continue;
      const double slope = turned.z() / (P.z() * P.z()) / scale;  // d new / d old
      const double own = kRelativeSigma * inverse;
      belief.mean = static_cast<float>(inverse);
      belief.variance = static_cast<float>(std::min(kInflation * old[i].variance * slope * slope + own * own,
                                                    0.99 * static_cast<double>(prior.variance)));
      // As sure of the ratio as the prior, but of the ratio that was found.
      const auto weight = static_cast<float>(options_.prior_inliers + options_.prior_outliers);
      belief.inliers = weight * old[i].inlier_ratio();
      belief.outliers = weight - belief.inliers;
    }
  }
}

FrameUse DepthFilter::update(const PosedImage& frame) {
  const FrameUse use = key_ ? check(frame) : FrameUse::kNoKeyFrame;
  if (use != FrameUse::kUsed) {
    ++refused_;
    return use;
  }
  T_frame_key_ = frame.T_world_camera.inverse() * key_->T_world_camera;
  // The frame's own error stands after T_frame_key, turned round; the key frame's before it.
  const Matrix6d carry = adjoint(T_frame_key_);
  Matrix6d covariance = frame.covariance + carry * key_->covariance * carry.transpose();
  last_time_ns_ = frame.capture_time_ns;
  ++frames_;
  double misfit_px = 0;
  if (refinement_) {
    const RefinedPose refined = refinement_->refine(frame.image, T_frame_key_, frame.covariance);
    T_frame_key_ = refined.T_frame_key;
    covariance = refined.covariance;
    misfit_px = refined.misfit_px;
    if (!refined.has_parallax) {
      policy_.add(counts_, 1);
      return FrameUse::kUsed;
    }
  }
  counts_ = backend_->update(frame.image, pair_geometry(camera_, T_frame_key_, covariance, misfit_px));
  policy_.add(counts_, counts_.planned > 0 ? 1 - static_cast<double>(counts_.not_visible) / counts_.planned : 1);
  return FrameUse::kUsed;
}

DepthMap DepthFilter::depth_map() const {
  if (!key_) throw std::logic_error("DepthFilter: no key frame has begun");
  std::vector<PixelBelief> beliefs;
  std::vector<PixelState> states;
  read(&beliefs, &states);
  DepthMap map;
  map.utime = key_->capture_time_ns / 1000;
  map.camera = camera_;
  map.T_world_camera = key_->T_world_camera;
  map.depth_m.assign(beliefs.size(), 0.0F);
  map.sigma_m.assign(beliefs.size(), 0.0F);
  map.state.assign(beliefs.size(), DepthState::kInvalid);
  const auto scale = static_cast<float>(refinement_ ? refinement_->scale() : 1);
  const auto scale_sigma = static_cast<float>(refinement_ ? refinement_->scale_sigma() : 0);
  const float untouched = prior_belief(options_).variance;
  for (std::size_t i = 0; i < beliefs.size(); ++i) {
    const PixelBelief& belief = beliefs[i];
    if (states[i] == PixelState::kBorder || states[i] == PixelState::kNoTexture) continue;
    if (states[i] == PixelState::kDiverged) {
      map.state[i] = DepthState::kDiverged;
      continue;
    }
    if (!(belief.variance < untouched)) continue;
    map.state[i] = states[i] == PixelState::kConverged ? DepthState::kConverged : DepthState::kUpdating;
    map.depth_m[i] = scale / belief.mean;
    const float own = scale * std::sqrt(belief.variance) / (belief.mean * belief.mean);
    map.sigma_m[i] = std::hypot(own, scale_sigma / belief.mean);
  }
  return map;
}

void DepthFilter::read(std::vector<PixelBelief>* beliefs, std::vector<PixelState>* states) const {
  beliefs->resize(beliefs_.size());
  states->resize(beliefs_.size());
  backend_->read(*beliefs, *states);
}

}  // namespace vantage
