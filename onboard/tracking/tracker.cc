#include "onboard/tracking/tracker.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "onboard/tracking/relocaliser.h"

namespace vantage::tracking {
namespace {

constexpr std::size_t kLocalKeyFrames = 10;
constexpr double kFoundShare = 0.2;  // of what should be visible, below which a pose is not believed
constexpr std::size_t kLeastAligned = 8;
constexpr int kYoungKeyFrames = 8;  // after a start, that may stand closer than later ones
constexpr double kYoungMapTrust = 0.05;
constexpr std::size_t kSettlingFrames = 600;  // whose priors say where and how large the map is
constexpr std::size_t kSettleEvery = 30;      // frames
constexpr double kLeastChange = 1e-3;         // of the scale, that is worth moving the map
constexpr int kLeastRefined = 8;
constexpr int kBridgeRms = 40;  // grey levels: above it no alignment is believed

}  // namespace

const char* name_of(TrackingState state) {
  switch (state) {
    case TrackingState::kStarting:
      return "starting";
    case TrackingState::kTracking:
      return "tracking";
    case TrackingState::kWeak:
      return "weak";
    case TrackingState::kLost:
      return "lost";
    case TrackingState::kRelocalising:
      return "relocalising";
  }
  return "";
}

bool TrackerOptions::valid(std::string* why) const {
  const auto fail = [why](const char* reason) {
    if (why != nullptr) *why = reason;
    return false;
  };
  if (!mapper.valid(why) || !start.valid(why) || !search.valid(why)) return false;
  if (!(scene_distance_m > 0)) return fail("scene_distance_m must be positive");
  if (lost_inliers < 6 || weak_inliers < lost_inliers) return fail("6 <= lost_inliers <= weak_inliers must hold");
  if (!(key_frame_parallax > 0) || !(key_frame_turn_rad > 0)) return fail("key_frame_... must be positive");
  if (alignment.finest_level < 0 || alignment.coarsest_level >= ImagePyramid::kLevels ||
      alignment.finest_level > alignment.coarsest_level) {
    return fail("alignment: 0 <= finest_level <= coarsest_level <= 4 must hold");
  }
  return true;
}

Tracker::Tracker(const CameraModel& camera, const TrackerOptions& options)
    : camera_(camera),
      options_(options),
      mapper_(camera, options.mapper),
      starter_(camera, options.start),
      rotation_(camera),
      alignment_(camera),
      search_(camera, options.search) {
  std::string why;
  if (!camera.valid(&why) || !options.valid(&why)) throw std::invalid_argument("Tracker: " + why);
}

TrackingResult Tracker::process(const Frame& frame, const std::optional<PosePrior>& prior) {
  TrackingResult result;
  result.sequence = frame.sequence;
  result.capture_time_ns = frame.capture_time_ns;
  result.state = state_;
  if (frame.image.empty() || frame.image.width != camera_.width || frame.image.height != camera_.height) return result;
  if (state_ == TrackingState::kStarting) {
    start(frame, prior, &result);
    return result;
  }
  const std::shared_ptr<const ImagePyramid> image = pyramids_.build(frame.image);
  TrackedFrame tracked;
  tracked.sequence = frame.sequence;
  tracked.capture_time_ns = frame.capture_time_ns;
  tracked.image = image;
  tracked.prior = prior;
  ++frames_since_start_;
  const bool had_pose = state_ == TrackingState::kTracking || state_ == TrackingState::kWeak;
  bool found = had_pose && track(image, frame.capture_time_ns, prior, &tracked, &result);
  if (!found) found = try_relocalise(image, &tracked, &result);
  if (found) {
    state_ = result.state = result.points < options_.weak_inliers ? TrackingState::kWeak : TrackingState::kTracking;
    result.relocalised = frames_without_pose_ > 0;
    frames_without_pose_ = 0;
    accept(tracked, result);
    if (robot_ && prior) {
      posed_.push_back(result);
      priors_.push_back(*prior);
      if (posed_.size() > kSettlingFrames) {
        posed_.pop_front();
        priors_.pop_front();
      }
      if (++frames_since_settled_ >= kSettleEvery) settle_in_robot_frame();
    }
    result.unit_sigma = unit_sigma_;
    return result;
  }
  state_ = result.state = had_pose ? TrackingState::kLost : TrackingState::kRelocalising;
  result.has_pose = false;
  ++frames_without_pose_;
  if (frames_since_start_ - frames_without_pose_ < options_.probation_frames &&
      frames_without_pose_ >= options_.probation_patience) {
    mapper_.undo_start();
    last_.reset();
    starter_.reset();
    bool empty = false;
    {
      const std::lock_guard lock(mapper_.mutex());
      empty = mapper_.map().key_frames().empty();
    }
    if (empty) state_ = result.state = TrackingState::kStarting;
    frames_since_start_ = options_.probation_frames + frames_without_pose_;  // what is left of the map is no start
  }
  if (frames_without_pose_ >= options_.new_piece_after || state_ == TrackingState::kStarting) {
    start(frame, prior, &result);
  }
  return result;
}

void Tracker::start(const Frame& frame, const std::optional<PosePrior>& prior, TrackingResult* result) {
  StartFrame start_frame{frame.sequence, frame.capture_time_ns, pyramids_.build(frame.image)};
  TrackedFrame tracked;
  if (prior) {
    tracked = mapper_.start(start_frame, *prior, options_.scene_distance_m);
    robot_ = true;
  } else {
    const std::optional<Start> found = starter_.add(start_frame);
    if (!found) return;
    tracked = mapper_.start(*found, options_.scene_distance_m);
    starter_.reset();
  }
  result->has_pose = result->began_map = true;
  result->relocalised = false;
  result->points = static_cast<int>(tracked.features.size());
  result->reference = tracked.reference;
  result->T_camera_reference = Eigen::Isometry3d::Identity();
  result->median_distance_m = options_.scene_distance_m;
  result->nearest_distance_m = 0.5 * options_.scene_distance_m;
  {
    const std::lock_guard lock(mapper_.mutex());
    T_camera_world_key_frame_ = *mapper_.pose_of(tracked.reference);
  }
  result->T_world_camera = T_camera_world_key_frame_.inverse();
  state_ = result->state = prior ? TrackingState::kWeak : TrackingState::kTracking;
  unit_sigma_ = std::numeric_limits<double>::infinity();
  key_frame_features_ = tracked.features.size();
  frames_since_key_frame_ = 0;
  frames_since_start_ = frames_without_pose_ = 0;
  key_frames_asked_for_ = 0;
  velocity_ = Eigen::Isometry3d::Identity();
  velocity_s_ = 0;
  last_ = Last{std::move(tracked), T_camera_world_key_frame_};
}

Eigen::Isometry3d Tracker::predict(std::int64_t time_ns, const std::optional<PosePrior>& prior) const {
  if (prior && robot_) {
    // The robot's own step: its noise is the same for both of its poses or small against the image's.
    if (last_->frame.prior) {
      return prior->T_world_camera.inverse() * last_->frame.prior->T_world_camera * last_->T_camera_world;
    }
    return prior->T_world_camera.inverse();
  }
  const double elapsed_s = static_cast<double>(time_ns - last_->frame.capture_time_ns) * 1e-9;
  const double ratio = velocity_s_ > 0 ? std::clamp(elapsed_s / velocity_s_, 0.0, 3.0) : 0;
  return renormalized(motion_exp(ratio * motion_log(velocity_)) * last_->T_camera_world);
}

Eigen::Isometry3d Tracker::align(const ImagePyramid& image, const Eigen::Isometry3d& T_predicted,
                                 const std::optional<PosePrior>& prior, bool* aligned) {
  alignment_points_.clear();
  const Map& map = mapper_.map();
  double distance_sum = 0;
  for (const Feature& feature : last_->frame.features) {
    const Landmark* landmark = map.landmark(feature.landmark);
    if (landmark == nullptr) continue;
    Eigen::Vector3d ray;
    if (!camera_.unproject(feature.pixel, &ray)) continue;
    const double distance = (last_->T_camera_world * landmark->position).norm();
    alignment_points_.push_back({feature.pixel, ray * distance});
    distance_sum += distance;
  }
  *aligned = false;
  if (alignment_points_.size() < kLeastAligned) return T_predicted;
  const double distance = distance_sum / static_cast<double>(alignment_points_.size());
  const Eigen::Isometry3d T_last_world = last_->T_camera_world;
  const Eigen::Isometry3d predicted = T_predicted * T_last_world.inverse();

  // Where to begin: what was predicted, the turn that the images show, and standing still. The coarsest level judges.
  const RotationAlignment::Result turn = rotation_.align(*last_->frame.image, image, predicted.linear());
  Eigen::Isometry3d turned = predicted;
  turned.linear() = turn.R_current_reference;
  Eigen::Isometry3d turned_only = Eigen::Isometry3d::Identity();
  turned_only.linear() = turn.R_current_reference;
  MotionPrior motion_prior;
  motion_prior.T_current_reference = predicted;
  if (prior && robot_) {
    motion_prior.sigma_translation_m = 1.5 * prior->sigma_translation_m;
    motion_prior.sigma_rotation_rad = 1.5 * prior->sigma_rotation_rad;
  } else {
    motion_prior.T_current_reference = turn.correlation > 0.7 ? turned : predicted;
    motion_prior.sigma_translation_m = 0.1 * distance;
    motion_prior.sigma_rotation_rad = 0.1;
  }
  AlignmentOptions coarse = options_.alignment;
  coarse.finest_level = coarse.coarsest_level;
  AlignmentResult best;
  best.T_current_reference = turn.correlation > 0.7 ? turned : predicted;
  best.rms = kBridgeRms;
  for (const Eigen::Isometry3d& begin : {predicted, turned, turned_only}) {
    const AlignmentResult trial =
        alignment_.align(*last_->frame.image, alignment_points_, image, begin, motion_prior, coarse);
    if (trial.visible >= static_cast<int>(kLeastAligned) && trial.rms < 0.98 * best.rms) best = trial;
  }
  AlignmentOptions fine = options_.alignment;
  fine.coarsest_level = std::max(fine.finest_level, fine.coarsest_level - 1);
  const AlignmentResult result =
      alignment_.align(*last_->frame.image, alignment_points_, image, best.T_current_reference, motion_prior, fine);
  *aligned = result.visible >= static_cast<int>(kLeastAligned);
  if (!*aligned) return renormalized(best.T_current_reference * T_last_world);
  return renormalized(result.T_current_reference * T_last_world);
}

std::vector<KeyFrameId> Tracker::local_key_frames(const Eigen::Isometry3d& T_camera_world) {
  Map& map = mapper_.map();
  std::map<KeyFrameId, int> votes;
  for (const Feature& feature : last_->frame.features) {
    const Landmark* landmark = map.landmark(feature.landmark);
    if (landmark == nullptr) continue;
    ++votes[landmark->host];
    for (const Observation& observation : landmark->observations) ++votes[observation.key_frame];
  }
  std::vector<std::pair<KeyFrameId, int>> sorted(votes.begin(), votes.end());
  std::stable_sort(sorted.begin(), sorted.end(), [](const auto& a, const auto& b) { return a.second > b.second; });
  std::vector<KeyFrameId> local;
  const int piece = mapper_.piece_of(last_->frame.reference);
  int newest = 0;
  for (auto frame = map.key_frames().rbegin(); frame != map.key_frames().rend() && newest < 3; ++frame) {
    if (frame->second.map != piece) continue;
    ++newest;
    local.push_back(frame->first);
  }
  for (const auto& [id, count] : sorted) {
    if (local.size() >= kLocalKeyFrames) break;
    if (std::find(local.begin(), local.end(), id) == local.end()) local.push_back(id);
  }
  // Those that look the same way from nearby, whether the last frame saw their points or not.
  const Eigen::Vector3d centre = T_camera_world.inverse().translation();
  const Eigen::Vector3d forward = T_camera_world.linear().row(2);
  std::vector<std::pair<double, KeyFrameId>> near;
  for (const auto& [id, frame] : map.key_frames()) {
    if (frame.map != piece) continue;
    const double distance = (frame.T_camera_world.inverse().translation() - centre).norm() / frame.median_distance_m;
    const double cosine = forward.dot(Eigen::Vector3d(frame.T_camera_world.linear().row(2)));
    if (distance < 0.6 && cosine > 0.75) near.emplace_back(distance + 2 * (1 - cosine), id);
  }
  std::sort(near.begin(), near.end());
  for (std::size_t i = 0, added = 0; i < near.size() && added < 4; ++i) {
    if (std::find(local.begin(), local.end(), near[i].second) != local.end()) continue;
    local.push_back(near[i].second);
    ++added;
  }
  return local;
}

void Tracker::fill(const MapMatches& matches, const RefinedPose& refined, const Eigen::Isometry3d& T_camera_world,
                   TrackedFrame* tracked, TrackingResult* result) {
  std::vector<double> distances;
  tracked->features.clear();
  for (std::size_t i = 0; i < matches.features.size(); ++i) {
    if (!matches.measurements[i].inlier) continue;
    tracked->features.push_back(matches.features[i]);
    distances.push_back((T_camera_world * matches.measurements[i].position).norm());
  }
  if (!distances.empty()) {
    std::sort(distances.begin(), distances.end());
    result->median_distance_m = distances[distances.size() / 2];
    result->nearest_distance_m = distances[distances.size() / 20];
  }
  result->has_pose = true;
  result->points = refined.inliers;
  result->covariance = refined.covariance;
  result->T_world_camera = T_camera_world.inverse();
  result->reference = tracked->reference;
  result->T_camera_reference = tracked->T_camera_reference;
  result->reference_scale = tracked->reference_scale = mapper_.scale_of(tracked->reference);
}

bool Tracker::track(const std::shared_ptr<const ImagePyramid>& image, std::int64_t time_ns,
                    const std::optional<PosePrior>& prior, TrackedFrame* tracked, TrackingResult* result) {
  const std::lock_guard lock(mapper_.mutex());
  const TrackedFrame& before = last_->frame;
  const auto T_last = mapper_.pose_of(before.reference, before.T_camera_reference, before.reference_scale);
  if (!T_last) return false;
  last_->T_camera_world = *T_last;  // where the map has moved it since

  bool aligned = false;
  const Eigen::Isometry3d predicted = predict(time_ns, prior);
  Eigen::Isometry3d T = align(*image, predicted, prior, &aligned);
  const std::vector<KeyFrameId> local = local_key_frames(T);
  search_.run(&mapper_.map(), local, *image, T, &matches_);
  std::optional<PosePrior> pose_prior = robot_ ? prior : std::nullopt;
  if (pose_prior && matches_.found < options_.weak_inliers) {
    // Seeds share the error of the guess that they began with: until there are points, the robot alone knows the way.
    pose_prior->sigma_translation_m *= kYoungMapTrust;
  }
  RefinedPose refined = refine_pose(camera_, matches_.measurements, pose_prior, &T);
  if (refined.inliers < options_.weak_inliers && refined.inliers >= kLeastRefined) {
    search_.run(&mapper_.map(), local, *image, T, &matches_, false);  // from a better place, more may be found
    refined = refine_pose(camera_, matches_.measurements, pose_prior, &T);
  }
  const bool few = refined.inliers < options_.lost_inliers ||
                   refined.inliers < kFoundShare * std::min(matches_.visible, options_.search.most_matches);
  if (few && !pose_prior) return false;
  KeyFrameId nearest = last_->frame.reference;
  for (const KeyFrameId id : local) {
    if (mapper_.map().key_frame(id) != nullptr) {
      nearest = id;
      break;
    }
  }
  tracked->reference = nearest;
  tracked->T_camera_reference = renormalized(T * mapper_.pose_of(nearest)->inverse());
  fill(matches_, refined, T, tracked, result);
  return true;
}

bool Tracker::try_relocalise(const std::shared_ptr<const ImagePyramid>& image, TrackedFrame* tracked,
                             TrackingResult* result) {
  const std::lock_guard lock(mapper_.mutex());
  const std::optional<Relocalised> found =
      relocalise(camera_, &mapper_.map(), mapper_.places(), *image, &search_, &rotation_);
  if (!found) return false;
  tracked->reference = found->place;
  tracked->T_camera_reference = renormalized(found->T_camera_world * mapper_.pose_of(found->place)->inverse());
  fill(found->matches, found->pose, found->T_camera_world, tracked, result);
  last_.reset();
  return true;
}

bool Tracker::key_frame_due(const TrackedFrame& tracked, const TrackingResult& result) {
  const Eigen::Isometry3d T_camera_world = result.T_world_camera.inverse();
  const Eigen::Isometry3d since = T_camera_world * T_camera_world_key_frame_.inverse();
  const double turn = rotation_log(Eigen::Quaterniond(since.linear())).norm();
  const double way = since.inverse().translation().norm() / std::max(1e-9, result.median_distance_m);
  if (turn > options_.key_frame_turn_rad) return true;
  const bool thin = static_cast<double>(tracked.features.size()) <
                    options_.key_frame_overlap * static_cast<double>(key_frame_features_);
  if (thin && (way > 0.02 || turn > 0.05)) return true;
  // A young map rests on few views: each that sees its points from elsewhere makes it stiffer.
  const bool young = key_frames_asked_for_ < kYoungKeyFrames;
  if (young && way > options_.key_frame_parallax / 3 && frames_since_key_frame_ >= 3) return true;
  if (way < options_.key_frame_parallax) return false;
  // None near: an old place that is seen again needs no new key frame while its points are found.
  const std::lock_guard lock(mapper_.mutex());
  const Eigen::Vector3d forward = T_camera_world.linear().row(2);
  const int piece = mapper_.piece_of(tracked.reference);
  for (const auto& [id, frame] : mapper_.map().key_frames()) {
    if (frame.map != piece) continue;
    const double distance = (frame.T_camera_world * result.T_world_camera.translation()).norm();
    const double cosine = forward.dot(Eigen::Vector3d(frame.T_camera_world.linear().row(2)));
    if (distance < options_.key_frame_parallax * result.median_distance_m &&
        cosine > std::cos(options_.key_frame_turn_rad)) {
      return thin;
    }
  }
  return true;
}

void Tracker::accept(const TrackedFrame& tracked, const TrackingResult& result) {
  const Eigen::Isometry3d T_camera_world = result.T_world_camera.inverse();
  if (last_ && !result.relocalised) {
    velocity_ = T_camera_world * last_->T_camera_world.inverse();
    velocity_s_ = static_cast<double>(tracked.capture_time_ns - last_->frame.capture_time_ns) * 1e-9;
  } else {
    velocity_ = Eigen::Isometry3d::Identity();
    velocity_s_ = 0;
  }
  ++frames_since_key_frame_;
  last_ = Last{tracked, T_camera_world};
  if (key_frame_due(tracked, result)) {
    T_camera_world_key_frame_ = T_camera_world;
    key_frame_features_ = tracked.features.size();
    frames_since_key_frame_ = 0;
    ++key_frames_asked_for_;
    mapper_.add_key_frame(tracked);
  } else {
    mapper_.observe(tracked);
  }
}

void Tracker::settle_in_robot_frame() {
  frames_since_settled_ = 0;
  const std::lock_guard lock(mapper_.mutex());
  std::vector<Eigen::Vector3d> ours, robots;
  double sigma_m = 0;
  for (std::size_t i = 0; i < posed_.size(); ++i) {
    if (posed_[i].state != TrackingState::kTracking) continue;
    const auto T = mapper_.pose_of(posed_[i].reference, posed_[i].T_camera_reference, posed_[i].reference_scale);
    if (!T || mapper_.piece_of(posed_[i].reference) != mapper_.piece_of(last_->frame.reference)) continue;
    ours.push_back(T->inverse().translation());
    robots.push_back(priors_[i].T_world_camera.translation());
    sigma_m = priors_[i].sigma_translation_m;
  }
  if (ours.size() < kSettleEvery) return;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : ours) mean += p / static_cast<double>(ours.size());
  double spread2 = 0;
  for (const Eigen::Vector3d& p : ours) spread2 += (p - mean).squaredNorm();
  // Scale from the spread of both about their means (the noise adds to the robot's: hence the product, not the ratio of
  // the spreads); its sigma is the noise over the root of the sum of squares.
  Eigen::Vector3d robots_mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : robots) robots_mean += p / static_cast<double>(robots.size());
  double product = 0;
  for (std::size_t i = 0; i < ours.size(); ++i) product += (ours[i] - mean).dot(robots[i] - robots_mean);
  const double scale = product / std::max(spread2, 1e-12);
  const double sigma = sigma_m / std::sqrt(std::max(spread2, 1e-12));
  unit_sigma_ = sigma;
  if (!(std::abs(scale - 1) > std::max(kLeastChange, sigma)) || sigma > 0.1 || !(scale > 0.2 && scale < 5)) return;
  Similarity change;
  change.scale = scale;
  change.translation = robots_mean - scale * mean;
  mapper_.move_piece(mapper_.piece_of(last_->frame.reference), change);
  Eigen::Isometry3d T_world_key_frame = T_camera_world_key_frame_.inverse();
  T_world_key_frame.translation() = change * T_world_key_frame.translation();
  T_camera_world_key_frame_ = T_world_key_frame.inverse();
}

TrackingResult Tracker::locate(const Frame& frame, const TrackingResult* neighbour, const Frame* neighbour_frame) {
  TrackingResult result;
  result.sequence = frame.sequence;
  result.capture_time_ns = frame.capture_time_ns;
  result.state = TrackingState::kRelocalising;
  if (frame.image.empty() || frame.image.width != camera_.width || frame.image.height != camera_.height) return result;
  const std::shared_ptr<const ImagePyramid> image = pyramids_.build(frame.image);
  TrackedFrame tracked;
  tracked.sequence = frame.sequence;
  tracked.capture_time_ns = frame.capture_time_ns;
  tracked.image = image;
  const std::optional<Last> kept = last_;
  bool found = false;
  if (neighbour != nullptr && neighbour_frame != nullptr) {
    if (const auto T = pose_of(*neighbour)) {
      // The neighbour's own points first: its pose is known, its features are sought anew.
      const std::lock_guard lock(mapper_.mutex());
      Last beside;
      beside.T_camera_world = T->inverse();
      beside.frame.image = pyramids_.build(neighbour_frame->image);
      beside.frame.capture_time_ns = neighbour_frame->capture_time_ns;
      beside.frame.reference = neighbour->reference;
      beside.frame.T_camera_reference = neighbour->T_camera_reference;
      beside.frame.reference_scale = neighbour->reference_scale;
      last_ = beside;
      search_.run(&mapper_.map(), local_key_frames(beside.T_camera_world), *beside.frame.image, beside.T_camera_world,
                  &matches_, false);
      last_->frame.features = matches_.features;
    }
    velocity_s_ = 0;
    found = track(image, frame.capture_time_ns, std::nullopt, &tracked, &result);
  }
  if (!found) found = try_relocalise(image, &tracked, &result);
  if (found) result.state = result.points < options_.weak_inliers ? TrackingState::kWeak : TrackingState::kTracking;
  last_ = kept;
  return result;
}

std::optional<Eigen::Isometry3d> Tracker::pose_of(const TrackingResult& result) {
  if (!result.has_pose) return std::nullopt;
  const std::lock_guard lock(mapper_.mutex());
  const auto T = mapper_.pose_of(result.reference, result.T_camera_reference, result.reference_scale);
  if (!T) return std::nullopt;
  return T->inverse();
}

int Tracker::piece_of(const TrackingResult& result) {
  const std::lock_guard lock(mapper_.mutex());
  return mapper_.piece_of(result.reference);
}

}  // namespace vantage::tracking
