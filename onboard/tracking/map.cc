#include "onboard/tracking/map.h"

#include <algorithm>
#include <cmath>

namespace vantage::tracking {

KeyFrame& Map::add_key_frame(KeyFrame key_frame) {
  key_frame.id = next_key_frame_++;
  return key_frames_.emplace(key_frame.id, std::move(key_frame)).first->second;
}

Landmark& Map::add_landmark(Landmark landmark) {
  landmark.id = next_landmark_++;
  Landmark& added = landmarks_.emplace(landmark.id, std::move(landmark)).first->second;
  if (KeyFrame* host = key_frame(added.host)) host->hosted.push_back(added.id);
  return added;
}

KeyFrame* Map::key_frame(KeyFrameId id) {
  const auto found = key_frames_.find(id);
  return found == key_frames_.end() ? nullptr : &found->second;
}

const KeyFrame* Map::key_frame(KeyFrameId id) const { return const_cast<Map*>(this)->key_frame(id); }

Landmark* Map::landmark(LandmarkId id) {
  const auto found = landmarks_.find(id);
  return found == landmarks_.end() ? nullptr : &found->second;
}

const Landmark* Map::landmark(LandmarkId id) const { return const_cast<Map*>(this)->landmark(id); }

void Map::observe(LandmarkId id, const Observation& observation) {
  Landmark* seen = landmark(id);
  KeyFrame* by = key_frame(observation.key_frame);
  if (seen == nullptr || by == nullptr) return;
  for (const Observation& known : seen->observations) {
    if (known.key_frame == observation.key_frame) return;
  }
  seen->observations.push_back(observation);
  by->features.push_back({id, observation.pixel, observation.level, seen->edgelet, observation.normal});
}

void Map::remove_observation(LandmarkId id, KeyFrameId by) {
  if (Landmark* seen = landmark(id)) {
    std::erase_if(seen->observations, [&](const Observation& o) { return o.key_frame == by; });
  }
  if (KeyFrame* frame = key_frame(by)) {
    std::erase_if(frame->features, [&](const Feature& f) { return f.landmark == id; });
  }
}

void Map::remove_landmark(LandmarkId id) {
  const Landmark* gone = landmark(id);
  if (gone == nullptr) return;
  for (const Observation& observation : gone->observations) {
    if (KeyFrame* frame = key_frame(observation.key_frame)) {
      std::erase_if(frame->features, [&](const Feature& f) { return f.landmark == id; });
    }
  }
  if (KeyFrame* host = key_frame(gone->host)) std::erase(host->hosted, id);
  landmarks_.erase(id);
}

void Map::remove_key_frame(KeyFrameId id) {
  KeyFrame* gone = key_frame(id);
  if (gone == nullptr) return;
  for (const Feature& feature : std::vector<Feature>(gone->features)) {
    if (Landmark* seen = landmark(feature.landmark)) {
      std::erase_if(seen->observations, [&](const Observation& o) { return o.key_frame == id; });
    }
  }
  for (const LandmarkId hosted : std::vector<LandmarkId>(gone->hosted)) {
    Landmark* orphan = landmark(hosted);
    if (orphan == nullptr) continue;
    if (!orphan->converged || orphan->observations.size() < 2) {
      remove_landmark(hosted);
      continue;
    }
    const Observation& heir = orphan->observations.front();
    KeyFrame* host = key_frame(heir.key_frame);
    orphan->host = heir.key_frame;
    orphan->pixel = heir.pixel;
    orphan->level = heir.level;
    orphan->normal = heir.normal;
    orphan->ray = (host->T_camera_world * orphan->position).normalized();
    host->hosted.push_back(hosted);
  }
  key_frames_.erase(id);
}

void Map::move_key_frame(KeyFrame* frame, const Similarity& S_new_old) {
  const Similarity camera = Similarity::from(frame->T_camera_world) * S_new_old.inverse();
  frame->T_camera_world.linear() = camera.rotation.toRotationMatrix();
  frame->T_camera_world.translation() = camera.translation / camera.scale;
  frame->median_distance_m *= S_new_old.scale;
  frame->scale *= S_new_old.scale;
  for (const LandmarkId id : frame->hosted) {
    Landmark* point = landmark(id);
    if (point == nullptr) continue;
    point->position = S_new_old * point->position;
    point->sigma_m *= S_new_old.scale;
    point->depth.mu /= S_new_old.scale;
    point->depth.sigma2 /= S_new_old.scale * S_new_old.scale;
    point->depth.range /= S_new_old.scale;
  }
}

void Map::merge_landmarks(LandmarkId into, LandmarkId from) {
  Landmark* kept = landmark(into);
  Landmark* gone = landmark(from);
  if (kept == nullptr || gone == nullptr || into == from) return;
  const std::vector<Observation> observations = gone->observations;
  remove_landmark(from);
  for (const Observation& observation : observations) observe(into, observation);
}

void Map::clear() {
  key_frames_.clear();
  landmarks_.clear();
}

std::vector<std::pair<KeyFrameId, int>> Map::covisible(KeyFrameId id) const {
  std::map<KeyFrameId, int> shared;
  const KeyFrame* frame = key_frame(id);
  if (frame == nullptr) return {};
  for (const Feature& feature : frame->features) {
    const Landmark* seen = landmark(feature.landmark);
    if (seen == nullptr) continue;
    for (const Observation& observation : seen->observations) {
      if (observation.key_frame != id) ++shared[observation.key_frame];
    }
  }
  std::vector<std::pair<KeyFrameId, int>> sorted(shared.begin(), shared.end());
  std::stable_sort(sorted.begin(), sorted.end(), [](const auto& a, const auto& b) { return a.second > b.second; });
  return sorted;
}

void Map::place_seed(Landmark* seed) const {
  const KeyFrame* host = key_frame(seed->host);
  seed->position = host->T_camera_world.inverse() * (seed->ray / std::max(seed->depth.mu, 1e-6));
  seed->sigma_m = std::min(1.0, seed->depth.sigma() / seed->depth.mu) / seed->depth.mu;
}

void Map::judge_point(Landmark* point, double ray_error_rad) const {
  const KeyFrame* host = key_frame(point->host);
  if (host == nullptr) return;
  const Eigen::Vector3d from_host = point->position - host->T_camera_world.inverse().translation();
  double smallest_cosine = 1;
  for (const Observation& observation : point->observations) {
    const KeyFrame* other = key_frame(observation.key_frame);
    if (other == nullptr) continue;
    const Eigen::Vector3d from_other = point->position - other->T_camera_world.inverse().translation();
    smallest_cosine = std::min(smallest_cosine, from_host.dot(from_other) / (from_host.norm() * from_other.norm()));
  }
  const double angle = std::acos(std::clamp(smallest_cosine, -1.0, 1.0));
  const double relative = ray_error_rad * (1 << point->level) / std::max(angle, 1e-6);
  point->sigma_m = std::min(relative, 0.2) * from_host.norm();
}

}  // namespace vantage::tracking
