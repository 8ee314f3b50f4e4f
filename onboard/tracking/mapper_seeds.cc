// Seeds: born with a key frame, sought in its neighbours, points once they have converged.

#include <algorithm>
#include <cmath>

#include "onboard/tracking/descriptor.h"
#include "onboard/tracking/landmark_search.h"
#include "onboard/tracking/mapper.h"
#include "onboard/tracking/pose_refinement.h"

namespace vantage::tracking {
namespace {

constexpr std::size_t kLookBack = 5;       // key frames in which a new seed is sought at once
constexpr std::size_t kConnections = 6;    // key frames in which a new point is sought at once
constexpr double kHopelessInliers = 0.25;  // a seed below this inlier ratio goes

}  // namespace

void Mapper::create_seeds(KeyFrameId id) {
  std::shared_ptr<const ImagePyramid> image;
  std::vector<Eigen::Vector2d> occupied;
  struct Known {
    Eigen::Vector2d pixel;
    double inverse_distance;
  };
  std::vector<Known> known;
  double nearest = 1e9, median_distance = 1;
  {
    const std::lock_guard lock(mutex_);
    const KeyFrame& frame = *map_.key_frame(id);
    image = frame.image;
    median_distance = frame.median_distance_m;
    for (const Feature& feature : frame.features) {
      occupied.push_back(feature.pixel);
      if (const Landmark* seen = map_.landmark(feature.landmark)) {
        const double distance = (frame.T_camera_world * seen->position).norm();
        known.push_back({feature.pixel, 1 / distance});
        nearest = std::min(nearest, distance);
      }
    }
  }
  nearest = std::clamp(nearest, 0.2 * median_distance, 0.6 * median_distance);
  const std::vector<Corner> corners = detect_corners(*image, occupied, options_.detector);
  std::vector<Landmark> seeds;
  seeds.reserve(corners.size());
  for (const Corner& corner : corners) {
    Landmark seed;
    if (!camera_.unproject(corner.pixel, &seed.ray)) continue;
    seed.host = id;
    seed.pixel = corner.pixel;
    seed.level = corner.level;
    seed.edgelet = corner.edgelet;
    seed.normal = corner.normal;
    // The points around say where to begin; the width of the belief stays, for a neighbour may be on another surface.
    double sum = 1e-3 / median_distance, weights = 1e-3;
    for (const Known& k : known) {
      const double square = (k.pixel - corner.pixel).squaredNorm() / (60.0 * 60.0);
      if (square > 9) continue;
      const double weight = std::exp(-square);
      sum += weight * k.inverse_distance;
      weights += weight;
    }
    seed.depth = DepthBelief::start(weights / sum, nearest);
    if (!seed.edgelet) {
      seed.described = describe(image->level(seed.level), to_level(seed.pixel.x(), seed.level),
                                to_level(seed.pixel.y(), seed.level), &seed.descriptor);
    }
    seeds.push_back(seed);
  }
  const std::lock_guard lock(mutex_);
  for (Landmark& seed : seeds) {
    map_.place_seed(&seed);
    map_.add_landmark(seed);
  }
}

void Mapper::update_seeds(const TrackedFrame& frame) {
  const std::lock_guard lock(mutex_);
  const auto T = pose_of(frame.reference, frame.T_camera_reference, frame.reference_scale);
  if (!T) return;
  const int piece = piece_of(frame.reference);
  std::vector<std::pair<const KeyFrame*, Landmark*>> seeds;
  std::size_t hosts = 0;
  for (auto host = map_.key_frames().rbegin(); host != map_.key_frames().rend() && hosts < kSeedKeyFrames; ++host) {
    if (host->second.map != piece) continue;
    ++hosts;
    for (const LandmarkId id : host->second.hosted) {
      Landmark* seed = map_.landmark(id);
      if (seed != nullptr && !seed->converged) seeds.emplace_back(&host->second, seed);
    }
  }
  const std::size_t turn = std::min(seeds.size(), static_cast<std::size_t>(options_.seeds_per_frame));
  std::vector<LandmarkId> hopeless, converged;
  for (std::size_t i = 0; i < turn; ++i) {
    const auto& [host, seed] = seeds[(seed_cursor_ + i) % seeds.size()];
    const SeedFate fate = update(*host, *frame.image, *T, seed);
    if (fate == SeedFate::kHopeless) hopeless.push_back(seed->id);
    if (fate == SeedFate::kConverged) converged.push_back(seed->id);
  }
  seed_cursor_ = turn < seeds.size() ? (seed_cursor_ + turn) % seeds.size() : 0;
  for (const LandmarkId id : hopeless) map_.remove_landmark(id);
  for (const LandmarkId id : converged) connect(id);
}

Mapper::SeedFate Mapper::update(const KeyFrame& host, const ImagePyramid& image,
                                const Eigen::Isometry3d& T_camera_world, Landmark* seed) const {
  if (update_seed(camera_, host, image, T_camera_world, seed) == SeedUpdate::kNotVisible) return SeedFate::kWaiting;
  if (seed->depth.inlier_ratio() < kHopelessInliers) return SeedFate::kHopeless;
  map_.place_seed(seed);
  return seed->depth.sigma() < options_.converged_share * seed->depth.mu &&
                 seed->depth.inlier_ratio() > options_.converged_inliers
             ? SeedFate::kConverged
             : SeedFate::kWaiting;
}

void Mapper::look_back(KeyFrameId id) {
  const std::lock_guard lock(mutex_);
  const KeyFrame& host = *map_.key_frame(id);
  std::vector<const KeyFrame*> earlier;
  for (auto other = map_.key_frames().rbegin(); other != map_.key_frames().rend() && earlier.size() < kLookBack;
       ++other) {
    if (other->first != id && other->second.map == host.map) earlier.push_back(&other->second);
  }
  std::vector<LandmarkId> hopeless, converged;
  for (const LandmarkId hosted : host.hosted) {
    Landmark* seed = map_.landmark(hosted);
    if (seed == nullptr || seed->converged) continue;
    SeedFate fate = SeedFate::kWaiting;
    for (const KeyFrame* other : earlier) {
      fate = update(host, *other->image, other->T_camera_world, seed);
      if (fate != SeedFate::kWaiting) break;
    }
    if (fate == SeedFate::kHopeless) hopeless.push_back(hosted);
    if (fate == SeedFate::kConverged) converged.push_back(hosted);
  }
  for (const LandmarkId seed : hopeless) map_.remove_landmark(seed);
  for (const LandmarkId seed : converged) connect(seed);
}

void Mapper::connect(LandmarkId id) {
  Landmark* landmark = map_.landmark(id);
  landmark->converged = true;
  const KeyFrameId host = landmark->host;
  map_.observe(id, {host, landmark->pixel, landmark->level, landmark->normal});
  const int piece = map_.key_frame(host)->map;
  std::size_t sought = 0;
  for (auto other = map_.key_frames().rbegin(); other != map_.key_frames().rend() && sought < kConnections; ++other) {
    if (other->first == host || other->second.map != piece) continue;
    ++sought;
    Feature feature;
    if (find_landmark(camera_, map_, *landmark, *other->second.image, other->second.T_camera_world, &feature)) {
      map_.observe(id, {other->first, feature.pixel, feature.level, feature.normal});
    }
  }
  refine_point(camera_, map_, landmark);
  map_.judge_point(landmark, kRayError_px / camera_.fx);
}

}  // namespace vantage::tracking
