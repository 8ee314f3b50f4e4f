// What goes: points not found again, seeds out of reach, redundant key frames.

#include <algorithm>

#include "onboard/tracking/mapper.h"

namespace vantage::tracking {
namespace {

constexpr int kMissedInRow = 20;            // a point that is visible and not found so often goes
constexpr double kRedundantShare = 0.9;     // of a key frame's points are seen by ...
constexpr std::size_t kRedundantViews = 4;  // ... so many others: it goes
constexpr std::size_t kYoungKeyFrames = 8;  // are never redundant
constexpr std::size_t kMostHeirs = 10000;   // key frames gone, whose frames' poses are still known

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
  // One that says nothing new, at a time: what made two of them redundant may have been each other. More only when
  // there are too many: every piece of map begins with two.
  for (const KeyFrameId id : redundant_key_frames(newest)) {
    if (drop_key_frame(id) && map_.key_frames().size() <= static_cast<std::size_t>(options_.most_key_frames)) break;
  }
}

std::vector<KeyFrameId> Mapper::redundant_key_frames(KeyFrameId newest) const {
  std::vector<KeyFrameId> redundant;
  std::vector<std::pair<double, KeyFrameId>> others;
  for (const auto& [id, frame] : map_.key_frames()) {
    if (id + kYoungKeyFrames > newest) break;
    int seen_elsewhere = 0, total = 0;
    for (const Feature& feature : frame.features) {
      const Landmark* landmark = map_.landmark(feature.landmark);
      if (landmark == nullptr) continue;
      ++total;
      seen_elsewhere += landmark->observations.size() > kRedundantViews;
    }
    const double share = total > 0 ? static_cast<double>(seen_elsewhere) / total : 1;
    if (share > kRedundantShare) {
      redundant.push_back(id);
    } else {
      others.emplace_back(-share, id);
    }
  }
  if (map_.key_frames().size() <= static_cast<std::size_t>(options_.most_key_frames)) return redundant;
  std::stable_sort(others.begin(), others.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  for (const auto& [share, id] : others) redundant.push_back(id);
  return redundant;
}

bool Mapper::drop_key_frame(KeyFrameId id) {
  const KeyFrame& gone = *map_.key_frame(id);
  KeyFrameId heir = 0;
  if (const auto covisible = map_.covisible(id); !covisible.empty()) {
    heir = covisible.front().first;
  } else {
    for (const auto& [other, frame] : map_.key_frames()) {
      if (other != id && frame.map == gone.map) heir = other;
    }
  }
  if (heir == 0) {  // all that is left of a piece of map: it stays while there is room
    if (map_.key_frames().size() <= static_cast<std::size_t>(options_.most_key_frames)) return false;
    forget_key_frame(id);
    return true;
  }
  const KeyFrame& left = *map_.key_frame(heir);
  const Heir inherited{heir, gone.T_camera_world * left.T_camera_world.inverse(), gone.scale, left.scale};
  for (auto& [other, known] : heirs_) {
    if (known.id != id) continue;
    // What was known relative to this one is known relative to its heir: lengths in the scale that this one has now.
    const double change = inherited.gone_scale / known.heir_scale;
    known.T_gone_heir.translation() *= change;
    known = {heir, known.T_gone_heir * inherited.T_gone_heir, known.gone_scale * change, inherited.heir_scale};
  }
  heirs_[id] = inherited;
  if (heirs_.size() > kMostHeirs) heirs_.erase(heirs_.begin());
  forget_key_frame(id);
  return true;
}

void Mapper::forget_key_frame(KeyFrameId id) {
  places_.remove(id);
  corrections_.erase(id);
  map_.remove_key_frame(id);
}

}  // namespace vantage::tracking
