#pragma once

#include <string>

#include "onboard/depth/depth_backend.h"

namespace vantage {

/// When a key frame has done its duty.
struct KeyFrameOptions {
  double enough_converged = 0.85;  ///< share of the pixels with texture
  int stall_frames = 15;           ///< so many frames in a row ...
  double stall_gain = 0.01;        ///< ... that together converge less than this share: no more will
  double least_visible = 0.5;      ///< share of the key frame that the last frame must still see
  int most_frames = 300;

  bool valid(std::string* why = nullptr) const;
};

/// Why a key frame ended.
enum class KeyFrameEnd { kNotYet, kEnoughConverged, kNoMoreWill, kViewMovedAway, kMostFrames };

/// In words, for a log.
const char* to_string(KeyFrameEnd end);

/// Watches a key frame's counts. kNoMoreWill is said only after something has converged: a camera that stands still
/// has not had its chance yet.
class KeyFramePolicy {
 public:
  explicit KeyFramePolicy(const KeyFrameOptions& options) : options_(options) {}

  void begin();
  /// `visible`: share of the key frame that the frame sees.
  void add(const UpdateCounts& counts, double visible);
  KeyFrameEnd end() const { return end_; }

 private:
  KeyFrameOptions options_;
  int frames_ = 0;
  int frames_since_gain_ = 0;
  double share_at_gain_ = 0;
  KeyFrameEnd end_ = KeyFrameEnd::kNotYet;
};

}  // namespace vantage
