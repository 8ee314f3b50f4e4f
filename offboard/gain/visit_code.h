#pragma once

#include <array>
#include <cstdint>

namespace vantage {

/// What a ray needs to know of a voxel, in 16 bits.
///
///   bits 0-6   entry of the visit table: joins log-odds, state and observed flag
///   bit  7     occplane voxel (Eq. 18)
///   bits 8-15  proximity d_max - d(x) in mark steps (Eq. 9); 0 unless unknown and marked
///
/// Entries are ordered unknown, free, stop: comparing with two bounds tells the class. The first free entry is kParked
/// (visibility 1, entropy 0), where the kernels leave rays that have ended; the first stop entry is the sentinel that
/// surrounds the region; occupied entries follow.
using VisitCode = std::uint16_t;
constexpr unsigned kEntryMask = 0x7f;
constexpr unsigned kOccplaneBit = 0x80;
constexpr int kProximityShift = 8;
constexpr int kMaxEntries = 128;

/// Numbers of a visit-table entry, 16 bytes so that one load fetches them all.
struct alignas(16) VisitEntry {
  float pass = 1;             ///< 1 - P_o: factor of the visibility (Eq. 4)
  float entropy = 0;          ///< I_o (Eq. 2), nats
  float unknown_entropy = 0;  ///< the same if unknown, else 0
  /// Sign bit: the ray stops here. The other bits: all set if unknown, none if not (a mask for a positive float).
  std::int32_t flags = 0;
};

struct VisitTable {
  /// By the low byte of the code: the upper half repeats the lower for occplane voxels.
  std::array<VisitEntry, 2 * kMaxEntries> entry;
  std::array<float, kMaxEntries> pass, entropy;  // the same as columns, for kernels that keep them in registers
  int unknown_end = 0;                           ///< entries [0, unknown_end) are unknown
  int stop_begin = 0;                            ///< entries [stop_begin, size) stop the ray
  int size = 0;

  int parked() const { return unknown_end; }
  int sentinel() const { return stop_begin; }
};

/// A GainField without its container, for the kernels.
struct FieldView {
  const VisitTable* table = nullptr;

  // Flat layout: offset of the first voxel's code, of a step along each axis, of a code that says "parked". A kernel
  // may read two bytes before and after any code.
  const VisitCode* codes = nullptr;
  std::array<std::int32_t, 3> strides{};
  std::int32_t first_offset = 0, parked_offset = 0;

  // Brick layout: one word a brick. Top bit: uniform; its entry in the low bits, and in kCubeMask log2 of the edge, in
  // bricks, of the aligned cube of like bricks it lies in. Else the brick's number, and whether a voxel has proximity.
  // Brick i has the low bytes of its codes at 512 i of `brick_codes`, their high bytes at the same place of
  // `brick_proximity` (not to be read when no voxel has any). A kernel may read three bytes past any code.
  const std::uint32_t* brick_words = nullptr;
  const std::uint8_t* brick_codes = nullptr;
  const std::uint8_t* brick_proximity = nullptr;
  std::array<std::int32_t, 3> brick_strides{};
  std::int32_t first_brick_offset = 0;

  static constexpr std::uint32_t kUniformBrick = 0x80000000, kHasProximity = 0x40000000;
  static constexpr std::uint32_t kBrickNumber = 0x1fffff;  // 1024^3 voxels have as many bricks
  static constexpr int kCubeShift = 8, kMaxLog2Cube = 3;
  static constexpr std::uint32_t kCubeMask = 3U << kCubeShift;
};

/// Where a brick keeps voxel (x, y, z): a cache line holds a cube of 4 x 4 x 4, so that a ray meets two lines a brick.
constexpr unsigned offset_in_brick(unsigned x, unsigned y, unsigned z) {
  return (x & 3) | (y & 3) << 2 | z << 4 | (y & 4) << 5 | (x & 4) << 6;
}

}  // namespace vantage
