#pragma once

#include <map>
#include <unordered_map>
#include <utility>
#include <vector>

#include "onboard/tracking/map.h"

namespace vantage::tracking {

/// Which key frames look like this? An inverted index over binary words: each descriptor is sixteen words, its sixteen
/// pieces of 16 bits; two that differ by fewer than 16 bits share one for certain (multi-index hashing: Norouzi,
/// Punjani and Fleet, CVPR 2012). Needs no vocabulary from elsewhere. A word counts the less the more key frames hold
/// it. Bounded by what it is given: forget key frames that go.
class PlaceIndex {
 public:
  void add(KeyFrameId key_frame, const std::vector<Descriptor>& descriptors);
  void remove(KeyFrameId key_frame);

  /// Key frames by how much they share with these descriptors, best first, at most `most`.
  std::vector<std::pair<KeyFrameId, double>> query(const std::vector<Descriptor>& descriptors, std::size_t most) const;

 private:
  std::unordered_map<std::uint32_t, std::vector<KeyFrameId>> holders_;  // of a word, each once
  std::map<KeyFrameId, std::vector<std::uint32_t>> words_;
};

}  // namespace vantage::tracking
