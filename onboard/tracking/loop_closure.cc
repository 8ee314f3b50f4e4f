#include "onboard/tracking/loop_closure.h"

#include <algorithm>
#include <random>
#include <set>

#include "onboard/tracking/descriptor.h"
#include "onboard/tracking/descriptor_matching.h"

namespace vantage::tracking {
namespace {

constexpr int kTrials = 300;
constexpr double kError_px = 6;  // reprojection, in both images

/// A landmark as one place sees it: in its camera's frame.
struct Sighting {
  LandmarkId id;
  Eigen::Vector3d point;
  Eigen::Vector2d pixel;
};

void sightings(const CameraModel& camera, const Map& map, const KeyFrame& frame, std::vector<Sighting>* seen,
               std::vector<Descriptor>* descriptors) {
  std::set<LandmarkId> ids(frame.hosted.begin(), frame.hosted.end());
  for (const Feature& feature : frame.features) ids.insert(feature.landmark);
  for (const LandmarkId id : ids) {
    const Landmark* landmark = map.landmark(id);
    if (landmark == nullptr || !landmark->converged || !landmark->described) continue;
    Sighting sighting{id, frame.T_camera_world * landmark->position, {}};
    if (!camera.project(sighting.point, &sighting.pixel)) continue;
    seen->push_back(sighting);
    descriptors->push_back(landmark->descriptor);
  }
}

}  // namespace

bool LoopOptions::valid(std::string* why) const {
  const auto fail = [why](const char* reason) {
    if (why != nullptr) *why = reason;
    return false;
  };
  if (least_matches < 8) return fail("least_matches must be at least 8");
  if (candidates < 1) return fail("candidates must be positive");
  if (apart < 1) return fail("apart must be positive");
  return true;
}

std::optional<LoopMatch> LoopCloser::find(const Map& map, const PlaceIndex& places, KeyFrameId query,
                                          bool metric) const {
  const KeyFrame* frame = map.key_frame(query);
  if (frame == nullptr) return std::nullopt;
  std::set<KeyFrameId> known{query};
  for (const auto& [other, shared] : map.covisible(query)) known.insert(other);
  std::vector<Sighting> here;
  std::vector<Descriptor> here_descriptors;
  sightings(camera_, map, *frame, &here, &here_descriptors);
  if (static_cast<int>(here.size()) < options_.least_matches) return std::nullopt;

  int looked_at = 0;
  for (const auto& [place, score] : places.query(here_descriptors, 30)) {
    const KeyFrame* other = map.key_frame(place);
    if (other == nullptr || known.count(place) != 0) continue;
    if (other->map == frame->map && query < place + static_cast<KeyFrameId>(options_.apart)) continue;
    if (++looked_at > options_.candidates) break;
    std::vector<Sighting> there;
    std::vector<Descriptor> there_descriptors;
    sightings(camera_, map, *other, &there, &there_descriptors);
    const auto pairs = match_descriptors(here_descriptors, there_descriptors);
    if (static_cast<int>(pairs.size()) < options_.least_matches) continue;

    const auto agrees = [&](const Similarity& S_place_query, const std::pair<int, int>& pair) {
      const Sighting& a = here[static_cast<std::size_t>(pair.first)];
      const Sighting& b = there[static_cast<std::size_t>(pair.second)];
      Eigen::Vector2d pixel;
      if (!camera_.project(S_place_query * a.point, &pixel) || (pixel - b.pixel).norm() > kError_px) return false;
      return camera_.project(S_place_query.inverse() * b.point, &pixel) && (pixel - a.pixel).norm() < kError_px;
    };
    std::mt19937 random(1);
    Similarity best;
    int most = 0;
    for (int trial = 0; trial < kTrials; ++trial) {
      std::array<Eigen::Vector3d, 3> from, to;
      for (std::size_t k = 0; k < 3; ++k) {
        const auto& pair = pairs[random() % pairs.size()];
        from[k] = here[static_cast<std::size_t>(pair.first)].point;
        to[k] = there[static_cast<std::size_t>(pair.second)].point;
      }
      if ((from[0] - from[1]).cross(from[0] - from[2]).norm() < 1e-4 * from[0].squaredNorm()) continue;
      const Similarity S = fit_similarity(from, to, !metric);
      if (!(S.scale > 0.05 && S.scale < 20)) continue;
      const int agreeing = static_cast<int>(
          std::count_if(pairs.begin(), pairs.end(), [&](const auto& pair) { return agrees(S, pair); }));
      if (agreeing > most) {
        most = agreeing;
        best = S;
      }
    }
    std::vector<std::pair<int, int>> inliers;
    for (int round = 0; round < 3 && most >= 6; ++round) {
      inliers.clear();
      std::vector<Eigen::Vector3d> from, to;
      for (const auto& pair : pairs) {
        if (!agrees(best, pair)) continue;
        inliers.push_back(pair);
        from.push_back(here[static_cast<std::size_t>(pair.first)].point);
        to.push_back(there[static_cast<std::size_t>(pair.second)].point);
      }
      if (from.size() < 6) break;
      best = fit_similarity(from, to, !metric);
    }
    if (static_cast<int>(inliers.size()) < options_.least_matches) continue;
    LoopMatch match;
    match.query = query;
    match.place = place;
    match.S_place_query = best;
    for (const auto& [i, j] : inliers) {
      match.pairs.emplace_back(there[static_cast<std::size_t>(j)].id, here[static_cast<std::size_t>(i)].id);
    }
    return match;
  }
  return std::nullopt;
}

}  // namespace vantage::tracking
