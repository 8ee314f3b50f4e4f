// One ray at a time through a field of bricks: a cube of like cells in one step, the others voxel by voxel.

#include <array>
#include <cstdint>

#include "offboard/gain/brick_walk.h"
#include "offboard/gain/cast_block.h"

namespace vantage {
namespace {

/// What a ray has seen so far.
struct Sight {
  double visibility = 1, run_entropy = 0;
  bool before_unknown = false, met_occplane = false;
};

}  // namespace

RaySums cast_bricks_scalar(const FieldView& field, const GridWalk& walk, const RayColumns& rays, std::size_t block) {
  RayPacket<kRaysPerBlock> packet;
  prepare_packet(walk, rays, block * kRaysPerBlock, &packet);
  const VisitTable& table = *field.table;
  const std::array<std::int32_t, 2> strides = field.brick_strides;
  RaySums sums;
  /// Enters a voxel; false when the ray ends there.
  const auto visit = [&](Sight* w, unsigned code, const std::uint8_t* proximity) {
    const int entry = static_cast<int>(code & kEntryMask);
    const VisitEntry& numbers = table.entry[code & kEntryMask];
    if (entry == table.sentinel()) return false;
    ++sums.visits;
    const double entropy = static_cast<double>(numbers.entropy), visible_entropy = w->visibility * entropy;
    sums.entropy += entropy;
    sums.occlusion_aware += visible_entropy;
    if (entry >= table.stop_begin) {
      sums.rear_side_voxels += w->before_unknown;
      sums.rear_side_entropy += w->run_entropy;
      sums.ends_occupied += !w->met_occplane;
      return false;
    }
    w->before_unknown = entry < table.unknown_end;
    if (w->before_unknown) {
      sums.unobserved_voxel += visible_entropy;
      w->run_entropy += visible_entropy;
      if (proximity != nullptr) sums.proximity_steps += *proximity;
      w->met_occplane = w->met_occplane || (code & kOccplaneBit) != 0;
    } else {
      w->run_entropy = 0;
    }
    w->visibility *= static_cast<double>(numbers.pass);
    return true;
  };
  for (std::size_t lane = 0; lane < kRaysPerBlock; ++lane) {
    if (packet.hits_region[lane] == 0) continue;
    BrickWalker w = BrickWalker::of(packet, lane);
    Sight sight;
    bool alive = true;
    while (alive) {
      const auto x = static_cast<unsigned>(w.voxel[0]), y = static_cast<unsigned>(w.voxel[1]),
                 z = static_cast<unsigned>(w.voxel[2]);
      const std::int32_t brick =
          field.first_brick + (w.voxel[0] >> 3) + (w.voxel[1] >> 3) * strides[0] + (w.voxel[2] >> 3) * strides[1];
      const std::uint32_t word = field.cell_words[8 * brick + static_cast<std::int32_t>(cell_in_brick(x, y, z))];
      if ((word & FieldView::kUniformCell) == 0) {
        const std::size_t first = std::size_t{64} * (word & FieldView::kCellNumber);
        const bool has_proximity = (word & FieldView::kHasProximity) != 0;
        bool inside = true;
        while (inside) {
          const std::size_t at =
              first + offset_in_cell(static_cast<unsigned>(w.voxel[0]), static_cast<unsigned>(w.voxel[1]),
                                     static_cast<unsigned>(w.voxel[2]));
          alive = visit(&sight, field.cell_codes[at] & ~table.octet_bit(),
                        has_proximity ? &field.cell_proximity[at] : nullptr);
          if (!alive) break;
          const std::size_t axis = w.next_axis();
          w.time[axis] += w.period[axis];
          const std::int32_t before = w.voxel[axis];
          w.voxel[axis] += w.direction[axis];
          inside = w.voxel[axis] >> 2 == before >> 2;
        }
        continue;
      }
      const int entry = static_cast<int>(word & kEntryMask);
      if (entry >= table.stop_begin) {
        alive = visit(&sight, word & kEntryMask, nullptr);
        continue;
      }
      // q^k and 1 + q + ... + q^(k-1) by k visits.
      const VisitEntry& numbers = table.entry[word & kEntryMask];
      const auto span = static_cast<std::int32_t>((word & FieldView::kSpanMask) >> FieldView::kSpanShift);
      const std::int32_t visits = leave_cube(&w, span + 1);
      const double q = static_cast<double>(numbers.pass), entropy = static_cast<double>(numbers.entropy);
      double power = 1, series = 0;
      for (std::int32_t k = 0; k < visits; ++k) {
        series += power;
        power *= q;
      }
      const double visible_entropy = sight.visibility * entropy * series;
      sums.visits += visits;
      sums.entropy += entropy * visits;
      sums.occlusion_aware += visible_entropy;
      sight.before_unknown = entry < table.unknown_end;
      sight.run_entropy = sight.before_unknown ? sight.run_entropy + visible_entropy : 0;
      if (sight.before_unknown) sums.unobserved_voxel += visible_entropy;
      sight.visibility *= power;
    }
    sums.ends_occplane += sight.met_occplane;
  }
  return sums;
}

}  // namespace vantage
