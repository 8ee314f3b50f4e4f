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
  /// For k voxels at once, q being `pass`: log2 q and 1 / (q - 1), so that q^k - 1, times the latter, is the series
  /// 1 + q + ... + q^(k-1). A q of 1 is taken for 2^(-2^-30), which gives k; one of 0 for 2^-126.
  std::array<float, kMaxEntries> log2_pass{}, series_scale{};
  int unknown_end = 0;  ///< entries [0, unknown_end) are unknown
  int stop_begin = 0;   ///< entries [stop_begin, size) stop the ray
  int size = 0;

  int parked() const { return unknown_end; }
  int sentinel() const { return stop_begin; }
  /// In the brick layout bit 6 of a code says that the octet, the aligned cube of 2^3 voxels that it lies in, is all of
  /// that code and lets rays through. Tables that need the bit for their entries have 0 here and no octets.
  unsigned octet_bit() const { return size <= kMaxEntries / 2 ? 0x40 : 0; }
};

/// A GainField without its container, for the kernels.
struct FieldView {
  const VisitTable* table = nullptr;

  // Flat layout: offset of the first voxel's code, of a step along each axis, of a code that says "parked". A kernel
  // may read two bytes before and after any code.
  const VisitCode* codes = nullptr;
  std::array<std::int32_t, 3> strides{};
  std::int32_t first_offset = 0, parked_offset = 0;

  // Brick layout: one word a cell of 4^3 voxels; the eight words of a brick stand together, cell (x, y, z) of it at
  // x + 2 y + 4 z, and those of brick (x, y, z) from 8 (first_brick + x + y brick_strides[0] + z brick_strides[1]).
  // Top bit: uniform; then its entry in the low bits, and in kSpanMask the edge, in voxels and less one, of the aligned
  // cube of like cells it lies in (0 where rays stop). Else the cell's number, and whether a voxel has proximity.
  // Cell i has the low bytes of its codes at 64 i of `cell_codes`, their high bytes at the same place of
  // `cell_proximity` (not to be read when no voxel has any). A kernel may read three bytes past any code.
  const std::uint32_t* cell_words = nullptr;
  const std::uint8_t* cell_codes = nullptr;
  const std::uint8_t* cell_proximity = nullptr;
  std::array<std::int32_t, 2> brick_strides{};  // of y and z, bricks
  std::int32_t first_brick = 0;

  static constexpr std::uint32_t kUniformCell = 0x80000000, kHasProximity = 0x40000000;
  static constexpr std::uint32_t kCellNumber = 0xffffff;  // 1024^3 voxels have as many cells
  static constexpr int kSpanShift = 8, kMaxEdge = 64;     // voxels
  static constexpr std::uint32_t kSpanMask = (kMaxEdge - 1U) << kSpanShift;
};

/// Where a cell keeps its voxel (x, y, z), of which the low two bits count: a cache line holds it whole.
constexpr unsigned offset_in_cell(unsigned x, unsigned y, unsigned z) { return (x & 3) | (y & 3) << 2 | (z & 3) << 4; }

/// Which word of its brick tells of voxel (x, y, z)'s cell.
constexpr unsigned cell_in_brick(unsigned x, unsigned y, unsigned z) { return (x >> 2 & 1) | (y >> 1 & 2) | (z & 4); }

}  // namespace vantage
