#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "offboard/gain/large_pages.h"
#include "offboard/gain/visit_code.h"

namespace vantage {

/// The brick layout of a GainField (see FieldView): a word a brick, a border of sentinel bricks around them, and the
/// codes of the bricks that are not uniform. Memory grows with those.
class BrickCodes {
 public:
  using Codes = std::array<VisitCode, 512>;  ///< voxel (x, y, z) is element x + 8 y + 64 z

  /// Empties the store; all bricks are sentinels. `expected` bricks will not be uniform.
  void reset(const Eigen::Vector3i& size_bricks, const VisitTable& table, std::size_t expected);

  /// Set a brick's codes. True when that changes one.
  bool set_uniform(const Eigen::Vector3i& brick, unsigned entry);
  bool set(const Eigen::Vector3i& brick, const Codes& codes);

  /// To be called after bricks were set: finds the cubes of like bricks that rays cross in one step.
  void join_cubes();

  const std::vector<std::uint32_t, LargePageAllocator<std::uint32_t>>& words() const { return words_; }
  std::size_t index(const Eigen::Vector3i& brick) const {
    return static_cast<std::size_t>((brick.x() + 1) * strides_[0] + (brick.y() + 1) * strides_[1] +
                                    (brick.z() + 1) * strides_[2]);
  }
  VisitCode code(const Eigen::Vector3i& voxel) const;
  void show(FieldView* view) const;
  std::size_t memory_bytes() const;

 private:
  Eigen::Vector3i size_{0, 0, 0};  // bricks, without the border
  std::array<std::int32_t, 3> strides_{};
  std::uint32_t stop_begin_ = 0;
  std::vector<std::uint32_t, LargePageAllocator<std::uint32_t>> words_;
  std::vector<std::uint8_t, LargePageAllocator<std::uint8_t>> codes_, proximity_;  // see FieldView
  std::vector<std::uint32_t> unused_;                                              // numbers given back
};

}  // namespace vantage
