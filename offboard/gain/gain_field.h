#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "offboard/gain/brick_codes.h"
#include "offboard/gain/visit_code.h"
#include "offboard/mapping/large_pages.h"
#include "offboard/mapping/occupancy_map.h"

namespace vantage {

/// A map as rays see it: one VisitCode a voxel, and the table that the codes point into.
///
/// Two layouts:
///  - flat, up to kMaxFlatVoxels: all voxels in x-fastest order with a border of sentinels one voxel wide, so that a
///    step along an axis is one addition and leaving the region needs no test;
///  - bricks, beyond (brick_codes.h).
class GainField {
 public:
  static constexpr std::size_t kMaxFlatVoxels = std::size_t{224} * 224 * 224;
  enum class Layout { kFlat, kBricks };

  /// Encodes the map, on so many threads. `fits()` tells whether it could be.
  explicit GainField(const OccupancyMap& map, int threads = 1);
  /// The same in a chosen layout.
  GainField(const OccupancyMap& map, Layout layout, int threads = 1);

  /// Encodes again what changed in the map since the last time, and appends to `changed`, when given, the bricks of
  /// which a code changed, or the steps in which rays cross them. `map` must be the one the field was made of, or a
  /// copy of it.
  void update(const OccupancyMap& map, std::vector<std::size_t>* changed = nullptr);

  /// False when the map holds more distinct log-odds values than the table has room for (kMaxEntries - 2): the kernels
  /// then can't be used, and nothing is encoded.
  bool fits() const { return fits_; }
  Layout layout() const { return layout_; }
  const VisitTable& table() const { return table_; }
  const Eigen::Vector3i& size_voxels() const { return size_; }
  /// Valid until the next update.
  FieldView view() const;

  VisitCode code(const Eigen::Vector3i& voxel) const;
  std::size_t memory_bytes() const;

 private:
  bool encode_levels(const OccupancyMap& map);
  void encode_all(const OccupancyMap& map, int threads);
  bool encode_brick(const OccupancyMap& map, std::size_t brick);
  bool encode_flat(const OccupancyMap& map, std::size_t brick);
  bool encode_words(const OccupancyMap& map, std::size_t brick);
  void fill_codes(const OccupancyMap& map, std::size_t brick, BrickCodes::Codes* codes) const;

  std::int32_t first_offset() const { return strides_[0] + strides_[1] + strides_[2]; }

  Layout layout_;
  Eigen::Vector3i size_;
  bool fits_ = false;
  std::uint32_t revision_ = 0;
  std::vector<std::uint8_t> entry_of_level_;
  std::vector<std::uint8_t> is_free_;  // by level
  std::size_t levels_encoded_ = 0;
  VisitTable table_;
  std::vector<VisitCode, LargePageAllocator<VisitCode>> codes_;
  std::array<std::int32_t, 3> strides_{};
  std::int32_t parked_offset_ = 0;
  BrickCodes bricks_;
};

}  // namespace vantage
