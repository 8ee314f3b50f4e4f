#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <unordered_map>
#include <vector>

#include "offboard/mapping/sensor_model.h"

namespace vantage {

/// Index of one of the log-odds values that occur in a map. Level 0 is the unobserved voxel's.
using Level = std::uint16_t;
constexpr Level kUnobservedLevel = 0;

/// What a measurement says of a voxel: seen through, or hit with full, half or a quarter of the hit's log-odds (a pixel
/// whose sigma is large against a voxel is a weaker witness).
enum class VoxelUpdate : std::uint8_t { kMiss = 0, kHit = 1, kHalfHit = 2, kQuarterHit = 3 };
constexpr int kVoxelUpdates = 4;

/// A voxel's state by the paper's thresholds: occupied P >= 0.8 - 1e-6, free P <= 0.2 + 1e-6, else uncertain;
/// unobserved is a flag of its own. "Unknown" is uncertain or unobserved.
enum class VoxelState : std::uint8_t { kUnobserved = 0, kFree = 1, kUncertain = 2, kOccupied = 3 };

VoxelState state_of_probability(double probability);

/// Voxel entropy in nats (Eq. 2).
double entropy_of_probability(double probability);

/// Every log-odds value that occurs in a map, and how updates lead from one to the next.
///
/// Repeated updates with clamping reach few distinct values (about twenty with the default model), so a voxel stores
/// the value's index and an update is one table look-up. Values are OctoMap's: float, v' = clamp(v + update). Values
/// that updates lead to are joined when they differ by less than kSameValue (rounding in another order of the same
/// updates); values that are set or imported are kept to the bit.
class LogOddsLevels {
 public:
  static constexpr float kSameValue = 4e-6F;
  static constexpr std::size_t kMaxLevels = 65535;

  explicit LogOddsLevels(const SensorModel& model);

  std::size_t size() const { return values_.size(); }
  float log_odds(Level level) const { return values_[level]; }
  double probability(Level level) const { return probabilities_[level]; }
  double entropy(Level level) const { return entropies_[level]; }
  VoxelState state(Level level) const { return states_[level]; }

  /// The level of exactly this value (but for the sign of zero). False when kMaxLevels distinct values are there
  /// already.
  bool find_or_add(float log_odds, Level* level);

  /// The level that an observed or unobserved voxel reaches by an update. With kMaxLevels levels taken, the nearest.
  Level after(VoxelUpdate update, Level level) {
    const Level next = next_[static_cast<std::size_t>(update)][level];
    return next != kNotComputed ? next : compute_next(update, level);
  }
  /// The observed levels in ascending order of log-odds.
  const std::map<float, Level>& by_value() const { return by_value_; }

  /// The log-odds that an update adds, before clamping.
  float increment(VoxelUpdate update) const { return increments_[static_cast<std::size_t>(update)]; }

 private:
  static constexpr Level kNotComputed = 0xffff;

  Level add(float log_odds, VoxelState state);
  Level compute_next(VoxelUpdate update, Level level);

  std::array<float, kVoxelUpdates> increments_;
  float clamp_min_, clamp_max_;
  std::vector<float> values_;
  std::vector<double> probabilities_, entropies_;
  std::vector<VoxelState> states_;
  std::array<std::vector<Level>, kVoxelUpdates> next_;
  std::unordered_map<std::uint32_t, Level> by_bits_;  // observed levels by the bits of their value
  std::map<float, Level> by_value_;                   // the same, in order
};

}  // namespace vantage
