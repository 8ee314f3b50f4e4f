#include "onboard/depth/key_frame_policy.h"

#include <numeric>

namespace vantage {
namespace {

bool fail(std::string* why, const char* reason) {
  if (why != nullptr) *why = reason;
  return false;
}

bool is_share(double value) { return value >= 0 && value <= 1; }

}  // namespace

bool KeyFrameOptions::valid(std::string* why) const {
  if (!is_share(enough_converged) || !is_share(stall_gain) || !is_share(least_visible)) {
    return fail(why, "key frame: shares must lie between 0 and 1");
  }
  if (stall_frames < 1 || most_frames < 1) return fail(why, "key frame: numbers of frames must be positive");
  return true;
}

const char* to_string(KeyFrameEnd end) {
  switch (end) {
    case KeyFrameEnd::kNotYet:
      return "not yet";
    case KeyFrameEnd::kEnoughConverged:
      return "enough has converged";
    case KeyFrameEnd::kNoMoreWill:
      return "no more will converge";
    case KeyFrameEnd::kViewMovedAway:
      return "the view has moved away";
    case KeyFrameEnd::kMostFrames:
      return "it has had as many frames as it may";
  }
  return "";
}

void KeyFramePolicy::begin() {
  frames_ = frames_since_gain_ = 0;
  share_at_gain_ = 0;
  end_ = KeyFrameEnd::kNotYet;
}

void KeyFramePolicy::add(const UpdateCounts& counts, double visible) {
  const auto pixels = [&counts](PixelState state) { return counts.states[static_cast<std::size_t>(state)]; };
  const int all = std::accumulate(counts.states.begin(), counts.states.end(), 0);
  const int searchable = all - pixels(PixelState::kBorder) - pixels(PixelState::kNoTexture);
  ++frames_;
  const double converged = searchable > 0 ? static_cast<double>(pixels(PixelState::kConverged)) / searchable : 0;
  ++frames_since_gain_;
  if (converged >= share_at_gain_ + options_.stall_gain) {
    share_at_gain_ = converged;
    frames_since_gain_ = 0;
  }
  if (converged >= options_.enough_converged) {
    end_ = KeyFrameEnd::kEnoughConverged;
  } else if (visible < options_.least_visible) {
    end_ = KeyFrameEnd::kViewMovedAway;
  } else if (share_at_gain_ > 0 && frames_since_gain_ >= options_.stall_frames) {
    end_ = KeyFrameEnd::kNoMoreWill;
  } else if (frames_ >= options_.most_frames) {
    end_ = KeyFrameEnd::kMostFrames;
  }
}

}  // namespace vantage
