#include "onboard/tracking/place_index.h"

#include <algorithm>
#include <cmath>

namespace vantage::tracking {
namespace {

/// The sixteen words of each descriptor, sorted, each once. The piece's number is the word's upper half.
std::vector<std::uint32_t> words_of(const std::vector<Descriptor>& descriptors) {
  std::vector<std::uint32_t> words;
  words.reserve(descriptors.size() * 16);
  for (const Descriptor& descriptor : descriptors) {
    for (std::uint32_t piece = 0; piece < 16; ++piece) {
      const auto bits = static_cast<std::uint32_t>(descriptor[piece / 4] >> (16 * (piece % 4)) & 0xFFFF);
      words.push_back(piece << 16 | bits);
    }
  }
  std::sort(words.begin(), words.end());
  words.erase(std::unique(words.begin(), words.end()), words.end());
  return words;
}

}  // namespace

void PlaceIndex::add(KeyFrameId key_frame, const std::vector<Descriptor>& descriptors) {
  remove(key_frame);
  std::vector<std::uint32_t> words = words_of(descriptors);
  for (const std::uint32_t word : words) holders_[word].push_back(key_frame);
  words_[key_frame] = std::move(words);
}

void PlaceIndex::remove(KeyFrameId key_frame) {
  const auto found = words_.find(key_frame);
  if (found == words_.end()) return;
  for (const std::uint32_t word : found->second) {
    const auto holders = holders_.find(word);
    std::erase(holders->second, key_frame);
    if (holders->second.empty()) holders_.erase(holders);
  }
  words_.erase(found);
}

std::vector<std::pair<KeyFrameId, double>> PlaceIndex::query(const std::vector<Descriptor>& descriptors,
                                                             std::size_t most) const {
  std::map<KeyFrameId, double> scores;
  const double all = static_cast<double>(words_.size());
  for (const std::uint32_t word : words_of(descriptors)) {
    const auto found = holders_.find(word);
    if (found == holders_.end()) continue;
    const double worth = std::log(1 + all / static_cast<double>(found->second.size()));
    for (const KeyFrameId holder : found->second) scores[holder] += worth;
  }
  for (auto& [key_frame, score] : scores) {
    score /= std::sqrt(static_cast<double>(1 + words_.at(key_frame).size()));
  }
  std::vector<std::pair<KeyFrameId, double>> sorted(scores.begin(), scores.end());
  std::stable_sort(sorted.begin(), sorted.end(), [](const auto& a, const auto& b) { return a.second > b.second; });
  if (sorted.size() > most) sorted.resize(most);
  return sorted;
}

}  // namespace vantage::tracking
