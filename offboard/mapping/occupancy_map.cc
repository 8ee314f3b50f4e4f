#include "offboard/mapping/occupancy_map.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>

namespace vantage {
namespace {

const Region& checked(const Region& region) {
  std::string why;
  if (!region.valid(&why)) throw std::invalid_argument(why);
  return region;
}

const SensorModel& checked(const SensorModel& model) {
  std::string why;
  if (!model.valid(&why)) throw std::invalid_argument("sensor model: " + why);
  return model;
}

/// True when every voxel has the first one's level and none a mark. Voxels beyond the region are kept alike too.
bool uniform(const OccupancyMap::Brick& brick) {
  const Level first = brick.level[0];
  if (brick.level.back() != first || (brick.mark.front() | brick.mark.back()) != 0) return false;  // most often
  unsigned different = 0;
  for (const Level level : brick.level) different |= static_cast<unsigned>(level ^ first);
  if (different != 0) return false;
  unsigned marks = 0;
  for (const std::uint8_t mark : brick.mark) marks |= mark;
  return marks == 0;
}

}  // namespace

OccupancyMap::OccupancyMap(const Region& region, const SensorModel& model)
    : region_(checked(region)),
      model_(checked(model)),
      size_bricks_((region.size_voxels.array() + (kBrickEdge - 1)) / kBrickEdge),
      levels_(model),
      slots_(static_cast<std::size_t>(size_bricks_.cast<std::int64_t>().prod())) {}

void OccupancyMap::clear() {
  const std::uint32_t revision = next_revision();
  unused_.resize(storage_.size());  // the storage stays: what fills it next is of the same size
  std::iota(unused_.begin(), unused_.end(), 0U);
  levels_ = LogOddsLevels(model_);
  slots_.assign(slots_.size(), Slot{.revision = revision});
  has_marks_ = false;
}

Eigen::Vector3i OccupancyMap::brick_position(std::size_t brick) const {
  const auto nx = static_cast<std::size_t>(size_bricks_.x()), ny = static_cast<std::size_t>(size_bricks_.y());
  return {static_cast<int>(brick % nx), static_cast<int>(brick / nx % ny), static_cast<int>(brick / (nx * ny))};
}

double OccupancyMap::occlusion_distance_m(const Eigen::Vector3i& voxel) const {
  const int steps = mark(voxel);
  return steps == 0 ? std::numeric_limits<double>::infinity() : (steps - 1) * mark_step_m();
}

VoxelState OccupancyMap::state_at(const Eigen::Vector3d& point) const {
  Eigen::Vector3i voxel;
  return region_.voxel_at(point, &voxel) ? state(voxel) : VoxelState::kUnobserved;
}

std::vector<std::int64_t> OccupancyMap::level_counts() const {
  std::vector<std::int64_t> counts(levels_.size(), 0);
  for (std::size_t b = 0; b < slots_.size(); ++b) {
    const Eigen::Vector3i extent = brick_extent(brick_position(b));
    const Brick* voxels = dense(b);
    if (voxels == nullptr) {
      counts[uniform_level(b)] += extent.prod();
      continue;
    }
    for (int z = 0; z < extent.z(); ++z) {
      for (int y = 0; y < extent.y(); ++y) {
        for (int x = 0; x < extent.x(); ++x) ++counts[voxels->level[static_cast<std::size_t>(x | y << 3 | z << 6)]];
      }
    }
  }
  return counts;
}

VoxelCounts OccupancyMap::counts() const {
  std::array<std::int64_t, 4> by_state{};
  const std::vector<std::int64_t> by_level = level_counts();
  for (std::size_t level = 0; level < by_level.size(); ++level) {
    by_state[static_cast<std::size_t>(levels_.state(static_cast<Level>(level)))] += by_level[level];
  }
  VoxelCounts counts{
      .unobserved = by_state[0], .free = by_state[1], .uncertain = by_state[2], .occupied = by_state[3], .marked = 0};
  for (std::size_t b = 0; b < slots_.size(); ++b) {
    const Brick* voxels = dense(b);
    if (voxels == nullptr) continue;
    const Eigen::Vector3i extent = brick_extent(brick_position(b));
    for (int z = 0; z < extent.z(); ++z) {
      for (int y = 0; y < extent.y(); ++y) {
        for (int x = 0; x < extent.x(); ++x) {
          counts.marked += voxels->mark[static_cast<std::size_t>(x | y << 3 | z << 6)] != 0;
        }
      }
    }
  }
  return counts;
}

double OccupancyMap::entropy_nats() const {
  // By value, in ascending order: the last bit does not depend on the map's history.
  const std::vector<std::int64_t> by_level = level_counts();
  double sum = static_cast<double>(by_level[kUnobservedLevel]) * levels_.entropy(kUnobservedLevel);
  for (const auto& [value, level] : levels_.by_value()) {
    sum += static_cast<double>(by_level[level]) * levels_.entropy(level);
  }
  return sum;
}

std::vector<Eigen::Vector3d> OccupancyMap::occupied_centers() const {
  std::vector<Eigen::Vector3d> centers;
  for_each_occupied([&](const Eigen::Vector3i& voxel) { centers.push_back(region_.center(voxel)); });
  return centers;
}

std::size_t OccupancyMap::memory_bytes() const {
  return sizeof *this + slots_.capacity() * sizeof(Slot) + storage_.size() * sizeof(Brick) +
         unused_.capacity() * sizeof(std::uint32_t) + levels_.size() * 128;
}

bool OccupancyMap::operator==(const OccupancyMap& other) const {
  if (!(region_ == other.region_ && model_ == other.model_)) return false;
  const auto same = [&](Level a, Level b) {
    return (a == kUnobservedLevel) == (b == kUnobservedLevel) && levels_.log_odds(a) == other.levels_.log_odds(b);
  };
  for (std::size_t b = 0; b < slots_.size(); ++b) {
    const Brick *mine = dense(b), *others = other.dense(b);
    if (mine == nullptr && others == nullptr) {
      if (!same(uniform_level(b), other.uniform_level(b))) return false;
      continue;
    }
    const Eigen::Vector3i position = brick_position(b), extent = brick_extent(position);
    for (int z = 0; z < extent.z(); ++z) {
      for (int y = 0; y < extent.y(); ++y) {
        for (int x = 0; x < extent.x(); ++x) {
          const Eigen::Vector3i voxel = kBrickEdge * position + Eigen::Vector3i(x, y, z);
          if (!same(level(voxel), other.level(voxel)) || mark(voxel) != other.mark(voxel)) return false;
        }
      }
    }
  }
  return true;
}

OccupancyMap::Brick& OccupancyMap::open(std::size_t brick) {
  Slot& slot = slots_[brick];
  if (slot.storage == kUniform) {
    if (unused_.empty()) {
      slot.storage = static_cast<std::uint32_t>(storage_.size());
      storage_.add();
    } else {
      slot.storage = unused_.back();
      unused_.pop_back();
    }
    storage_[slot.storage].level.fill(slot.level);
    storage_[slot.storage].mark.fill(0);
  }
  return storage_[slot.storage];
}

void OccupancyMap::close(std::size_t brick, bool changed) {
  Slot& slot = slots_[brick];
  if (changed) slot.revision = revision_;
  if (slot.storage == kUniform) return;
  const Brick& voxels = storage_[slot.storage];
  if (!uniform(voxels)) return;
  slot.level = voxels.level[0];
  unused_.push_back(slot.storage);
  slot.storage = kUniform;
}

void OccupancyMap::reset(std::size_t brick) {
  Slot& slot = slots_[brick];
  if (slot.storage != kUniform) unused_.push_back(slot.storage);
  slot = Slot{.storage = kUniform, .revision = revision_, .level = kUnobservedLevel};
}

bool OccupancyMap::set_log_odds(const Eigen::Vector3i& voxel, float log_odds) {
  Level level = kUnobservedLevel;
  if (!std::isfinite(log_odds) || !levels_.find_or_add(log_odds, &level)) return false;
  const std::size_t brick = brick_index(voxel / kBrickEdge);
  next_revision();
  open(brick).level[index_in_brick(voxel)] = level;
  close(brick, true);
  return true;
}

void OccupancyMap::set_unobserved(const Eigen::Vector3i& voxel) {
  const std::size_t brick = brick_index(voxel / kBrickEdge);
  next_revision();
  open(brick).level[index_in_brick(voxel)] = kUnobservedLevel;
  close(brick, true);
}

void OccupancyMap::set_occlusion_distance(const Eigen::Vector3i& voxel, double distance_m) {
  const bool marked = distance_m >= 0 && distance_m <= model_.occlusion_range_m;
  const std::size_t brick = brick_index(voxel / kBrickEdge);
  next_revision();
  open(brick).mark[index_in_brick(voxel)] = marked ? mark_of_distance(distance_m) : std::uint8_t{0};
  has_marks_ |= marked;
  close(brick, true);
}

}  // namespace vantage
