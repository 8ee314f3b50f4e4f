// What goes: points not found again, seeds out of reach, redundant key frames.

#include "onboard/tracking/mapper.h"

namespace vantage::tracking {
namespace {

constexpr int kMissedInRow = 20;            // a point that is visible and not found so often goes
constexpr double kRedundantShare = 0.9;     // of a key frame's points are seen by ...
constexpr std::size_t kRedundantViews = 4;  // ... so many others: it goes
constexpr std::size_t kYoungKeyFrames = 8;  // are never redundant

}  // namespace

void Mapper::cull(KeyFrameId newest) {
  const std::lock_guard lock(mutex_);
  const KeyFrame* centre = map_.key_frame(newest);
  if (centre == nullptr) return;
  // Points that are not found where they should be, and seeds that nobody will see again.
  std::vector<LandmarkId> gone;
  std::size_t age = 0;
  for (auto frame = map_.key_frames().rbegin(); frame != map_.key_frames().rend() && age < 40; ++frame, ++age) {
    for (const LandmarkId id : frame->second.hosted) {
      const Landmark* landmark = map_.landmark(id);
      if (landmark == nullptr) continue;
      const bool missing =
          landmark->converged && landmark->missed_in_row > kMissedInRow && 4 * landmark->found < landmark->tried;
      const bool forgotten = !landmark->converged && age > 2 * kSeedKeyFrames;
      if (missing || forgotten) gone.push_back(id);
    }
  }
  for (const LandmarkId id : gone) map_.remove_landmark(id);
  // Key frames that say nothing new.
  std::vector<KeyFrameId> redundant;
  const bool full = map_.key_frames().size() > static_cast<std::size_t>(options_.most_key_frames);
  KeyFrameId most_redundant = 0;
  double largest_share = -1;
  for (const auto& [id, frame] : map_.key_frames()) {
    if (id + kYoungKeyFrames > newest) break;
    if (frame.features.empty()) {
      redundant.push_back(id);
      continue;
    }
    int seen_elsewhere = 0, total = 0;
    for (const Feature& feature : frame.features) {
      const Landmark* landmark = map_.landmark(feature.landmark);
      if (landmark == nullptr) continue;
      ++total;
      seen_elsewhere += landmark->observations.size() > kRedundantViews;
    }
    const double share = total > 0 ? static_cast<double>(seen_elsewhere) / total : 1;
    if (share > kRedundantShare) redundant.push_back(id);
    if (share > largest_share) {
      largest_share = share;
      most_redundant = id;
    }
  }
  if (redundant.empty() && full && most_redundant != 0) redundant.push_back(most_redundant);
  // One at a time: what made two of them redundant may have been each other.
  if (!redundant.empty()) drop_key_frame(redundant.front());
}

void Mapper::drop_key_frame(KeyFrameId id) {
  const KeyFrame& gone = *map_.key_frame(id);
  KeyFrameId heir = 0;
  if (const auto covisible = map_.covisible(id); !covisible.empty()) {
    heir = covisible.front().first;
  } else {
    for (const auto& [other, frame] : map_.key_frames()) {
      if (other != id && frame.map == gone.map) heir = other;
    }
  }
  if (heir == 0) return;
  const KeyFrame& left = *map_.key_frame(heir);
  heirs_[id] = {heir, gone.T_camera_world * left.T_camera_world.inverse(), gone.scale, left.scale};
  places_.remove(id);
  map_.remove_key_frame(id);
}

}  // namespace vantage::tracking
