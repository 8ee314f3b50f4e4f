#include "offboard/mapping/log_odds_levels.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace vantage {
namespace {

constexpr double kOccupied = 0.8, kFree = 0.2, kEpsilon = 1e-6;

float log_odds_of(double probability) { return static_cast<float>(std::log(probability / (1 - probability))); }

}  // namespace

VoxelState state_of_probability(double probability) {
  if (probability >= kOccupied - kEpsilon) return VoxelState::kOccupied;
  if (probability <= kFree + kEpsilon) return VoxelState::kFree;
  return VoxelState::kUncertain;
}

double entropy_of_probability(double probability) {
  const double p = probability, q = 1 - probability;
  return (p > 0 ? -p * std::log(p) : 0) + (q > 0 ? -q * std::log(q) : 0);
}

LogOddsLevels::LogOddsLevels(const SensorModel& model)
    : clamp_min_(log_odds_of(model.clamp_min)), clamp_max_(log_odds_of(model.clamp_max)) {
  const float hit = log_odds_of(model.hit_probability);
  increments_ = {log_odds_of(model.miss_probability), hit, hit / 2, hit / 4};
  add(0, VoxelState::kUnobserved);
}

Level LogOddsLevels::add(float log_odds, VoxelState state) {
  const auto level = static_cast<Level>(values_.size());
  const double probability = 1 / (1 + std::exp(-static_cast<double>(log_odds)));
  values_.push_back(log_odds);
  probabilities_.push_back(probability);
  entropies_.push_back(entropy_of_probability(probability));
  states_.push_back(state);
  for (auto& next : next_) next.push_back(kNotComputed);
  if (state != VoxelState::kUnobserved) {
    by_bits_.emplace(std::bit_cast<std::uint32_t>(log_odds), level);
    by_value_.emplace(log_odds, level);
  }
  return level;
}

bool LogOddsLevels::find_or_add(float log_odds, Level* level) {
  if (log_odds == 0) log_odds = 0;  // one zero, whatever its sign
  const auto found = by_bits_.find(std::bit_cast<std::uint32_t>(log_odds));
  if (found != by_bits_.end()) {
    *level = found->second;
    return true;
  }
  if (values_.size() >= kMaxLevels) return false;
  *level = add(log_odds, state_of_probability(1 / (1 + std::exp(-static_cast<double>(log_odds)))));
  return true;
}

Level LogOddsLevels::compute_next(VoxelUpdate update, Level level) {
  const float value =
      std::clamp(values_[level] + increments_[static_cast<std::size_t>(update)], clamp_min_, clamp_max_);
  // The nearest level on either side; a clamped value is found exactly.
  Level next = kNotComputed;
  float distance = values_.size() >= kMaxLevels ? INFINITY : kSameValue;
  const auto above = by_value_.lower_bound(value);
  if (above != by_value_.end() && above->first - value < distance) {
    next = above->second;
    distance = above->first - value;
  }
  if (above != by_value_.begin()) {
    const auto below = std::prev(above);
    if (value - below->first < distance) next = below->second;
  }
  if (next == kNotComputed) next = add(value, state_of_probability(1 / (1 + std::exp(-static_cast<double>(value)))));
  next_[static_cast<std::size_t>(update)][level] = next;
  return next;
}

}  // namespace vantage
