#include "offboard/gain/gain_field.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "offboard/gain/parallel_tasks.h"

namespace vantage {
namespace {

constexpr int kEdge = OccupancyMap::kBrickEdge;
constexpr std::size_t kVoxels = OccupancyMap::kBrickVoxels;
constexpr std::size_t kFrontPad = 1;  // kernels read a code as the upper half of 32 bits
constexpr std::uint8_t kNoEntry = 0xff;

std::size_t flat_size(const Eigen::Vector3i& size) {
  return static_cast<std::size_t>(size.x() + 2) * static_cast<std::size_t>(size.y() + 2) *
         static_cast<std::size_t>(size.z() + 2);
}

enum class VisitClass { kUnknown, kFree, kStop };

VisitClass class_of(VoxelState state) {
  switch (state) {
    case VoxelState::kFree:
      return VisitClass::kFree;
    case VoxelState::kOccupied:
      return VisitClass::kStop;
    default:
      return VisitClass::kUnknown;
  }
}

void fill(VisitTable* table, int entry, double pass, double entropy, VisitClass visit_class) {
  const auto i = static_cast<std::size_t>(entry);
  VisitEntry& numbers = table->entry[i];
  numbers.pass = static_cast<float>(pass);
  numbers.entropy = static_cast<float>(entropy);
  const bool unknown = visit_class == VisitClass::kUnknown;
  numbers.unknown_entropy = unknown ? numbers.entropy : 0;
  numbers.flags = unknown                            ? std::numeric_limits<std::int32_t>::max()
                  : visit_class == VisitClass::kStop ? std::numeric_limits<std::int32_t>::min()
                                                     : 0;
  table->entry[i + kMaxEntries] = numbers;
  table->pass[i] = numbers.pass;
  table->entropy[i] = numbers.entropy;
  const double log2_pass = std::clamp(std::log2(static_cast<double>(numbers.pass)), -126.0, -0x1p-30);
  table->log2_pass[i] = static_cast<float>(log2_pass);
  table->series_scale[i] = static_cast<float>(1 / std::expm1(log2_pass * std::numbers::ln2));
}

/// Which voxels of a brick, and of the layer around it, are free.
class FreeVoxels {
 public:
  FreeVoxels(const OccupancyMap& map, const std::vector<std::uint8_t>& is_free, std::size_t brick) {
    const OccupancyMap::Brick& voxels = *map.dense(brick);
    for (int z = 0; z < kEdge; ++z) {
      for (int y = 0; y < kEdge; ++y) {
        for (int x = 0; x < kEdge; ++x) {
          free_[at(x, y, z)] = is_free[voxels.level[static_cast<std::size_t>(x | y << 3 | z << 6)]];
        }
      }
    }
    const Eigen::Vector3i position = map.brick_position(brick), bricks = map.size_bricks();
    for (int axis = 0; axis < 3; ++axis) {
      for (const int side : {-1, 1}) {
        Eigen::Vector3i beside = position;
        beside[axis] += side;
        if (beside[axis] < 0 || beside[axis] >= bricks[axis]) continue;
        const std::size_t index = map.brick_index(beside);
        const OccupancyMap::Brick* neighbour = map.dense(index);
        Eigen::Vector3i voxel;
        const int u = (axis + 1) % 3, v = (axis + 2) % 3;
        for (voxel[u] = 0; voxel[u] < kEdge; ++voxel[u]) {
          for (voxel[v] = 0; voxel[v] < kEdge; ++voxel[v]) {
            voxel[axis] = side < 0 ? kEdge - 1 : 0;
            const Level level =
                neighbour == nullptr ? map.uniform_level(index) : neighbour->level[OccupancyMap::index_in_brick(voxel)];
            voxel[axis] = side < 0 ? -1 : kEdge;
            free_[at(voxel.x(), voxel.y(), voxel.z())] = is_free[level];
          }
        }
      }
    }
    // What lies in the brick but beyond the region is no one's neighbour.
    const Eigen::Vector3i extent = map.brick_extent(position);
    if (extent != Eigen::Vector3i::Constant(kEdge)) {
      for (int z = 0; z < kEdge; ++z) {
        for (int y = 0; y < kEdge; ++y) {
          for (int x = 0; x < kEdge; ++x) {
            if (x >= extent.x() || y >= extent.y() || z >= extent.z()) free_[at(x, y, z)] = 0;
          }
        }
      }
    }
  }

  /// True when a face neighbour of voxel `i` of the brick is free.
  bool beside(std::size_t i) const {
    const std::size_t center = at(static_cast<int>(i & 7), static_cast<int>(i >> 3 & 7), static_cast<int>(i >> 6));
    return (free_[center - 1] | free_[center + 1] | free_[center - kRow] | free_[center + kRow] |
            free_[center - kLayer] | free_[center + kLayer]) != 0;
  }

 private:
  static constexpr std::size_t kRow = kEdge + 2, kLayer = kRow * kRow;

  static std::size_t at(int x, int y, int z) {
    return static_cast<std::size_t>(x + 1) + kRow * static_cast<std::size_t>(y + 1) +
           kLayer * static_cast<std::size_t>(z + 1);
  }

  std::array<std::uint8_t, kRow * kLayer> free_{};
};

}  // namespace

GainField::GainField(const OccupancyMap& map, int threads)
    : GainField(map, flat_size(map.region().size_voxels) <= kMaxFlatVoxels ? Layout::kFlat : Layout::kBricks, threads) {
}

GainField::GainField(const OccupancyMap& map, Layout layout, int threads)
    : layout_(layout), size_(map.region().size_voxels) {
  fits_ = encode_levels(map);
  if (fits_) encode_all(map, threads);
}

/// Gives every level of the map an entry of the table. False when there are too many.
bool GainField::encode_levels(const OccupancyMap& map) {
  const LogOddsLevels& levels = map.levels();
  levels_encoded_ = levels.size();
  constexpr std::size_t kRoom = kMaxEntries - 2;
  std::vector<Level> used;  // in ascending order of log-odds; the unobserved level first
  used.push_back(kUnobservedLevel);
  const bool crowded = levels.size() > kRoom;
  const std::vector<std::int64_t> counts = crowded ? map.level_counts() : std::vector<std::int64_t>();
  for (const auto& [value, level] : levels.by_value()) {
    if (!crowded || counts[level] > 0) used.push_back(level);
  }
  entry_of_level_.assign(levels.size(), kNoEntry);
  is_free_.clear();
  for (std::size_t level = 0; level < levels.size(); ++level) {
    is_free_.push_back(levels.state(static_cast<Level>(level)) == VoxelState::kFree);
  }
  table_ = VisitTable{};
  int next = 0;
  for (const VisitClass visit_class : {VisitClass::kUnknown, VisitClass::kFree, VisitClass::kStop}) {
    if (visit_class != VisitClass::kUnknown) {
      (visit_class == VisitClass::kFree ? table_.unknown_end : table_.stop_begin) = next;
      if (next >= kMaxEntries) return false;
      fill(&table_, next++, 1, 0, visit_class);  // parked, sentinel
    }
    const Level* joined = nullptr;
    for (const Level& level : used) {
      if (class_of(levels.state(level)) != visit_class) continue;
      // In a crowded map, values that differ by rounding alone share an entry.
      const bool join = crowded && joined != nullptr && *joined != kUnobservedLevel &&
                        levels.log_odds(level) - levels.log_odds(*joined) < LogOddsLevels::kSameValue;
      if (join) {
        entry_of_level_[level] = static_cast<std::uint8_t>(next - 1);
        continue;
      }
      if (next >= kMaxEntries) return false;
      fill(&table_, next, 1 / (1 + std::exp(static_cast<double>(levels.log_odds(level)))), levels.entropy(level),
           visit_class);
      entry_of_level_[level] = static_cast<std::uint8_t>(next++);
      joined = &level;
    }
  }
  table_.size = next;
  return true;
}

void GainField::encode_all(const OccupancyMap& map, int threads) {
  revision_ = map.revision();
  const auto sentinel = static_cast<VisitCode>(table_.sentinel());
  if (layout_ == Layout::kFlat) {
    strides_ = {1, size_.x() + 2, (size_.x() + 2) * (size_.y() + 2)};
    const std::size_t size = flat_size(size_);
    codes_.assign(kFrontPad + size + 2, sentinel);
    parked_offset_ = static_cast<std::int32_t>(size);
    codes_[kFrontPad + size] = static_cast<VisitCode>(table_.parked());
  } else {
    std::size_t dense = 0;
    for (std::size_t brick = 0; brick < map.brick_count(); ++brick) dense += map.dense(brick) != nullptr;
    bricks_.reset(map.size_bricks(), table_, dense);
  }
  // In the flat layout bricks have places of their own; in the other each new one moves the end of the codes.
  constexpr std::size_t kBricksPerTask = 64;
  const std::size_t count = map.brick_count();
  run_tasks((count + kBricksPerTask - 1) / kBricksPerTask, layout_ == Layout::kFlat ? threads : 1,
            [&](std::size_t task) {
              const std::size_t end = std::min(count, (task + 1) * kBricksPerTask);
              for (std::size_t brick = task * kBricksPerTask; brick < end; ++brick) encode_brick(map, brick);
            });
  if (layout_ == Layout::kBricks) bricks_.join_cubes();
}

void GainField::update(const OccupancyMap& map, std::vector<std::size_t>* changed) {
  std::vector<std::uint8_t> stale(map.brick_count(), 0);
  const Eigen::Vector3i bricks = map.size_bricks();
  const std::array<std::size_t, 3> strides = {
      1, static_cast<std::size_t>(bricks.x()),
      static_cast<std::size_t>(bricks.x()) * static_cast<std::size_t>(bricks.y())};
  for (std::size_t brick = 0; brick < stale.size(); ++brick) {
    if (map.brick_revision(brick) <= revision_) continue;
    stale[brick] = 1;
    // A free voxel at a brick's face makes occplane voxels of the neighbour's.
    const Eigen::Vector3i position = map.brick_position(brick);
    for (int axis = 0; axis < 3; ++axis) {
      if (position[axis] > 0) stale[brick - strides[static_cast<std::size_t>(axis)]] = 1;
      if (position[axis] + 1 < bricks[axis]) stale[brick + strides[static_cast<std::size_t>(axis)]] = 1;
    }
  }
  if (map.levels().size() != levels_encoded_ || !fits_) {
    fits_ = encode_levels(map);
    if (fits_) encode_all(map, 1);
    if (changed != nullptr) {
      for (std::size_t brick = 0; brick < stale.size(); ++brick) {
        if (stale[brick] != 0) changed->push_back(brick);
      }
    }
    revision_ = map.revision();
    return;
  }
  revision_ = map.revision();
  const auto words_before = bricks_.words();
  for (std::size_t brick = 0; brick < stale.size(); ++brick) {
    if (stale[brick] != 0 && encode_brick(map, brick) && changed != nullptr) changed->push_back(brick);
  }
  if (layout_ == Layout::kFlat) return;
  bricks_.join_cubes();
  for (std::size_t brick = 0; brick < stale.size() && changed != nullptr; ++brick) {
    const auto first = static_cast<std::ptrdiff_t>(bricks_.index(map.brick_position(brick)));
    if (!std::equal(words_before.begin() + first, words_before.begin() + first + BrickCodes::kCellsPerBrick,
                    bricks_.words().begin() + first)) {
      changed->push_back(brick);
    }
  }
}

/// Codes of a brick's voxels.
void GainField::fill_codes(const OccupancyMap& map, std::size_t brick, BrickCodes::Codes* codes) const {
  if (map.dense(brick) == nullptr) {
    codes->fill(entry_of_level_[map.uniform_level(brick)]);
    return;
  }
  const OccupancyMap::Brick& voxels = *map.dense(brick);
  unsigned marks = 0;
  for (std::size_t i = 0; i < kVoxels; ++i) {
    (*codes)[i] = entry_of_level_[voxels.level[i]];
    marks |= voxels.mark[i];
  }
  if (marks == 0) return;
  const FreeVoxels free(map, is_free_, brick);
  for (std::size_t i = 0; i < kVoxels; ++i) {
    if (voxels.mark[i] == 0 || (*codes)[i] >= table_.unknown_end) continue;
    const auto proximity = static_cast<unsigned>(OccupancyMap::kMarkSteps + 1 - voxels.mark[i]);
    (*codes)[i] =
        static_cast<VisitCode>((*codes)[i] | (free.beside(i) ? kOccplaneBit : 0) | proximity << kProximityShift);
  }
}

/// True when a code changed.
bool GainField::encode_brick(const OccupancyMap& map, std::size_t brick) {
  return layout_ == Layout::kFlat ? encode_flat(map, brick) : encode_words(map, brick);
}

bool GainField::encode_flat(const OccupancyMap& map, std::size_t brick) {
  const Eigen::Vector3i position = map.brick_position(brick), extent = map.brick_extent(position);
  const Eigen::Vector3i first = kEdge * position;
  BrickCodes::Codes codes;
  fill_codes(map, brick, &codes);
  VisitCode* corner =
      &codes_[kFrontPad] + first_offset() + first.x() * strides_[0] + first.y() * strides_[1] + first.z() * strides_[2];
  unsigned different = 0;
  for (int z = 0; z < extent.z(); ++z) {
    for (int y = 0; y < extent.y(); ++y) {
      VisitCode* row = corner + y * strides_[1] + z * strides_[2];
      const VisitCode* from = &codes[static_cast<std::size_t>(y << 3 | z << 6)];
      for (int x = 0; x < extent.x(); ++x) {
        different |= static_cast<unsigned>(row[x] ^ from[x]);
        row[x] = from[x];
      }
    }
  }
  return different != 0;
}

bool GainField::encode_words(const OccupancyMap& map, std::size_t brick) {
  const Eigen::Vector3i position = map.brick_position(brick), extent = map.brick_extent(position);
  const bool whole = extent == Eigen::Vector3i::Constant(kEdge);
  if (map.dense(brick) == nullptr && whole) {
    return bricks_.set_uniform(position, entry_of_level_[map.uniform_level(brick)]);
  }
  BrickCodes::Codes codes;
  fill_codes(map, brick, &codes);
  for (int z = 0; z < kEdge && !whole; ++z) {
    for (int y = 0; y < kEdge; ++y) {
      for (int x = 0; x < kEdge; ++x) {
        if (x < extent.x() && y < extent.y() && z < extent.z()) continue;
        codes[static_cast<std::size_t>(x | y << 3 | z << 6)] = static_cast<VisitCode>(table_.sentinel());
      }
    }
  }
  return bricks_.set(position, codes);
}

FieldView GainField::view() const {
  FieldView view;
  view.table = &table_;
  view.codes = codes_.data() + kFrontPad;
  view.strides = strides_;
  view.first_offset = first_offset();
  view.parked_offset = parked_offset_;
  bricks_.show(&view);
  return view;
}

VisitCode GainField::code(const Eigen::Vector3i& voxel) const {
  if (layout_ == Layout::kFlat) {
    return codes_[kFrontPad + static_cast<std::size_t>(first_offset() + voxel.x() * strides_[0] +
                                                       voxel.y() * strides_[1] + voxel.z() * strides_[2])];
  }
  return bricks_.code(voxel);
}

std::size_t GainField::memory_bytes() const {
  return sizeof *this + codes_.capacity() * sizeof(VisitCode) + bricks_.memory_bytes() + entry_of_level_.capacity();
}

}  // namespace vantage
