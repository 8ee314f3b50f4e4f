#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "offboard/gain/visit_code.h"
#include "offboard/mapping/large_pages.h"

namespace vantage {

/// The brick layout of a GainField (see FieldView): a word for every cell of 4^3 voxels, a border of sentinel bricks
/// around them, and the codes of the cells that are not uniform. The words take half a bit a voxel, the codes grow with
/// what is not uniform.
class BrickCodes {
 public:
  using Codes = std::array<VisitCode, 512>;  ///< voxel (x, y, z) is element x + 8 y + 64 z
  static constexpr std::size_t kCellsPerBrick = 8;

  /// Empties the store; all bricks are sentinels. `expected` bricks will not be uniform.
  void reset(const Eigen::Vector3i& size_bricks, const VisitTable& table, std::size_t expected);

  /// Set a brick's codes. True when that changes one.
  bool set_uniform(const Eigen::Vector3i& brick, unsigned entry);
  bool set(const Eigen::Vector3i& brick, const Codes& codes);

  /// To be called after bricks were set: finds the cubes of like cells that rays cross in one step.
  void join_cubes();

  const std::vector<std::uint32_t, LargePageAllocator<std::uint32_t>>& words() const { return words_; }
  /// Where a brick's words begin.
  std::size_t index(const Eigen::Vector3i& brick) const {
    return kCellsPerBrick *
           static_cast<std::size_t>((brick.x() + 1) + (brick.y() + 1) * strides_[0] + (brick.z() + 1) * strides_[1]);
  }
  VisitCode code(const Eigen::Vector3i& voxel) const;
  void show(FieldView* view) const;
  std::size_t memory_bytes() const;

 private:
  using CellCodes = std::array<VisitCode, 64>;  // by offset_in_cell()

  bool set_cell(std::uint32_t* word, const CellCodes& codes);
  bool set_uniform_cell(std::uint32_t* word, unsigned entry);
  void mark_octets(CellCodes* codes) const;
  bool stops(std::uint32_t code) const { return (code & kEntryMask) >= stop_begin_; }

  Eigen::Vector3i size_{0, 0, 0};          // bricks, without the border
  std::array<std::int32_t, 2> strides_{};  // of y and z, bricks
  std::uint32_t stop_begin_ = 0;
  unsigned octet_bit_ = 0;
  std::vector<std::uint32_t, LargePageAllocator<std::uint32_t>> words_;
  std::vector<std::uint8_t, LargePageAllocator<std::uint8_t>> codes_, proximity_;  // see FieldView
  std::vector<std::uint32_t> unused_;                                              // cells' numbers given back
};

}  // namespace vantage
