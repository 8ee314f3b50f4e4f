// The yardstick kernel: one ray at a time, sums in double precision, flat fields.

#include "offboard/gain/cast_block.h"

namespace vantage {

RaySums cast_flat_scalar(const FieldView& field, const GridWalk& walk, const RayColumns& rays, std::size_t block) {
  RayPacket<kRaysPerBlock> packet;
  prepare_packet(walk, rays, block * kRaysPerBlock, &packet);
  const VisitTable& table = *field.table;
  const std::array<std::int32_t, 3> strides = field.strides;
  RaySums sums;
  for (std::size_t lane = 0; lane < kRaysPerBlock; ++lane) {
    if (packet.hits_region[lane] == 0) continue;
    std::array<std::int32_t, 3> time, period, step;
    std::int32_t at = field.first_offset;
    for (std::size_t a = 0; a < 3; ++a) {
      time[a] = packet.time[a][lane];
      period[a] = packet.period[a][lane];
      step[a] = packet.direction[a][lane] * strides[a];
      at += packet.voxel[a][lane] * strides[a];
    }
    double visibility = 1, run_entropy = 0;
    bool before_unknown = false, met_occplane = false;
    while (true) {
      const unsigned code = field.codes[at];
      const int entry = static_cast<int>(code & kEntryMask);
      if (entry == table.sentinel()) break;
      const VisitEntry& numbers = table.entry[code & kEntryMask];
      ++sums.visits;
      const double entropy = static_cast<double>(numbers.entropy), visible_entropy = visibility * entropy;
      sums.entropy += entropy;
      sums.occlusion_aware += visible_entropy;
      if (entry >= table.stop_begin) {
        sums.rear_side_voxels += before_unknown;
        sums.rear_side_entropy += run_entropy;
        sums.ends_occupied += !met_occplane;
        break;
      }
      before_unknown = entry < table.unknown_end;
      if (before_unknown) {
        sums.unobserved_voxel += visible_entropy;
        run_entropy += visible_entropy;
        sums.proximity_steps += code >> kProximityShift;
        met_occplane = met_occplane || (code & kOccplaneBit) != 0;
      } else {
        run_entropy = 0;
      }
      visibility *= static_cast<double>(numbers.pass);
      const std::size_t axis = time[0] <= time[1] ? (time[0] <= time[2] ? 0U : 2U) : (time[1] <= time[2] ? 1U : 2U);
      time[axis] += period[axis];
      at += step[axis];
    }
    sums.ends_occplane += met_occplane;
  }
  return sums;
}

}  // namespace vantage
