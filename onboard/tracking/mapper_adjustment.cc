// The local bundle adjustment: what it gathers, holds and writes back.

#include <algorithm>
#include <set>

#include "onboard/tracking/mapper.h"

namespace vantage::tracking {

void Mapper::adjust_locally(KeyFrameId id) {
  AdjustmentProblem problem;
  std::vector<KeyFrameId> pose_ids;
  std::vector<LandmarkId> point_ids;
  std::vector<std::pair<KeyFrameId, LandmarkId>> observation_ids;
  std::size_t free = 0;
  {
    const std::lock_guard lock(mutex_);
    const KeyFrame* centre = map_.key_frame(id);
    if (centre == nullptr) return;
    pose_ids.push_back(id);
    const auto covisible = map_.covisible(id);
    for (const auto& [other, shared] : covisible) {
      if (static_cast<int>(pose_ids.size()) < options_.window && shared >= 8) pose_ids.push_back(other);
    }
    free = pose_ids.size();
    std::set<LandmarkId> points;
    std::map<KeyFrameId, int> outside;
    for (const KeyFrameId pose : pose_ids) {
      for (const Feature& feature : map_.key_frame(pose)->features) {
        const Landmark* landmark = map_.landmark(feature.landmark);
        if (landmark == nullptr || !landmark->converged || landmark->observations.size() < 2) continue;
        if (!points.insert(feature.landmark).second) continue;
        for (const Observation& o : landmark->observations) {
          if (std::find(pose_ids.begin(), pose_ids.end(), o.key_frame) == pose_ids.end()) ++outside[o.key_frame];
        }
      }
    }
    std::vector<std::pair<KeyFrameId, int>> holding(outside.begin(), outside.end());
    std::stable_sort(holding.begin(), holding.end(), [](const auto& a, const auto& b) { return a.second > b.second; });
    for (const auto& [other, shared] : holding) {
      if (pose_ids.size() < free + static_cast<std::size_t>(options_.fixed_frames)) pose_ids.push_back(other);
    }
    std::map<KeyFrameId, int> pose_index;
    bool any_prior = false;
    for (std::size_t i = 0; i < pose_ids.size(); ++i) {
      const KeyFrame& frame = *map_.key_frame(pose_ids[i]);
      pose_index[pose_ids[i]] = static_cast<int>(i);
      problem.poses.push_back({frame.T_camera_world, i >= free, frame.prior});
      any_prior |= frame.prior.has_value();
    }
    for (const LandmarkId point : points) {
      const Landmark& landmark = *map_.landmark(point);
      const int index = static_cast<int>(problem.points.size());
      int views = 0;
      for (const Observation& o : landmark.observations) views += static_cast<int>(pose_index.count(o.key_frame));
      if (views < (landmark.edgelet ? 3 : 2)) continue;  // two views of an edge leave a point free along it
      problem.points.push_back(landmark.position);
      point_ids.push_back(point);
      for (const Observation& o : landmark.observations) {
        const auto pose = pose_index.find(o.key_frame);
        if (pose == pose_index.end()) continue;
        problem.observations.push_back({.pose = pose->second,
                                        .point = index,
                                        .pixel = o.pixel,
                                        .sigma_px = static_cast<double>(1 << o.level),
                                        .edgelet = landmark.edgelet,
                                        .normal = o.normal});
        observation_ids.emplace_back(o.key_frame, point);
      }
    }
    // Without metric information and with too little that holds it, the two oldest poses hold frame and scale.
    if (!any_prior && pose_ids.size() - free < 2) {
      std::vector<std::size_t> by_age(free);
      for (std::size_t i = 0; i < free; ++i) by_age[i] = i;
      std::sort(by_age.begin(), by_age.end(), [&](std::size_t a, std::size_t b) { return pose_ids[a] < pose_ids[b]; });
      problem.poses[by_age[0]].fixed = true;
      if (free > 1 && pose_ids.size() == free) {
        problem.kept_distance = {static_cast<int>(by_age[0]), static_cast<int>(by_age[1])};
      }
    }
  }
  if (problem.points.size() < 10 || pose_ids.size() < 2) return;
  const std::vector<AdjustedPose> before = problem.poses;
  if (!adjust(camera_, &problem, options_.adjustment).usable) return;

  const std::lock_guard lock(mutex_);
  std::map<KeyFrameId, Eigen::Isometry3d> moved;  // T_new_world^-1 T_old_world: how hosted points move
  for (std::size_t i = 0; i < free; ++i) {
    KeyFrame* frame = map_.key_frame(pose_ids[i]);
    if (frame == nullptr || before[i].fixed) continue;
    moved[pose_ids[i]] = problem.poses[i].T_camera_world.inverse() * frame->T_camera_world;
    frame->T_camera_world = problem.poses[i].T_camera_world;
  }
  std::set<LandmarkId> adjusted;
  for (std::size_t i = 0; i < point_ids.size(); ++i) {
    if (Landmark* landmark = map_.landmark(point_ids[i])) {
      landmark->position = problem.points[i];
      map_.judge_point(landmark, kRayError_px / camera_.fx);
    }
    adjusted.insert(point_ids[i]);
  }
  for (std::size_t i = 0; i < problem.observations.size(); ++i) {
    if (!problem.observations[i].inlier) map_.remove_observation(observation_ids[i].second, observation_ids[i].first);
  }
  for (const LandmarkId point : point_ids) {
    const Landmark* landmark = map_.landmark(point);
    if (landmark != nullptr && landmark->observations.size() < 2) map_.remove_landmark(point);
  }
  for (const auto& [host, motion] : moved) {
    for (const LandmarkId hosted : map_.key_frame(host)->hosted) {
      Landmark* landmark = map_.landmark(hosted);
      if (landmark != nullptr && adjusted.count(hosted) == 0) landmark->position = motion * landmark->position;
    }
  }
}

}  // namespace vantage::tracking
