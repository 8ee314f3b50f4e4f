// One ray at a time through a field of bricks: a uniform brick in one step, the others voxel by voxel.

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>

#include "offboard/gain/cast_block.h"

namespace vantage {
namespace {

constexpr std::int32_t kEdge = 8;

/// How many of the crossings at time, time + period, ... come before `end`, or, with `ties`, not after it.
std::int32_t crossings_before(std::int32_t end, bool ties, std::int32_t time, std::int32_t period, float inverse) {
  const std::int32_t last = ties ? end : end - 1;
  if (time > last) return 0;
  // Single precision finds the quotient but for one; integers settle it.
  auto count = static_cast<std::int32_t>(static_cast<float>(last - time) * inverse);
  const std::int64_t reached = time + static_cast<std::int64_t>(count) * period;
  if (reached > last) {
    --count;
  } else if (reached + period <= last) {
    ++count;
  }
  return count + 1;
}

/// One ray in flight.
struct Walker {
  std::array<std::int32_t, 3> time, period, direction, voxel;
  std::array<float, 3> inverse;
  double visibility = 1, run_entropy = 0;
  bool before_unknown = false, met_occplane = false;

  std::size_t next_axis() const {
    return time[0] <= time[1] ? (time[0] <= time[2] ? 0U : 2U) : (time[1] <= time[2] ? 1U : 2U);
  }
};

/// Leaves the brick in one step; the number of its voxels that were met, the present one included.
std::int32_t leave_brick(Walker* w) {
  std::array<std::int32_t, 3> ahead, exit;  // faces to cross to be out of the brick along each axis; when
  for (std::size_t a = 0; a < 3; ++a) {
    const std::int32_t in_brick = w->voxel[a] & (kEdge - 1);
    ahead[a] = w->direction[a] > 0 ? kEdge - in_brick : in_brick + 1;
    const std::int64_t at = w->time[a] + static_cast<std::int64_t>(ahead[a] - 1) * w->period[a];
    exit[a] = static_cast<std::int32_t>(std::min<std::int64_t>(at, std::numeric_limits<std::int32_t>::max()));
  }
  const std::size_t out = exit[0] <= exit[1] ? (exit[0] <= exit[2] ? 0U : 2U) : (exit[1] <= exit[2] ? 1U : 2U);
  std::int32_t visits = ahead[out];
  for (std::size_t a = 0; a < 3; ++a) {
    const std::int32_t count =
        a == out ? ahead[a] : crossings_before(exit[out], a < out, w->time[a], w->period[a], w->inverse[a]);
    if (a != out) visits += count;
    w->voxel[a] += count * w->direction[a];
    w->time[a] += count * w->period[a];
  }
  return visits;
}

}  // namespace

RaySums cast_bricks_scalar(const FieldView& field, const GridWalk& walk, const RayColumns& rays, std::size_t block) {
  RayPacket<kRaysPerBlock> packet;
  prepare_packet(walk, rays, block * kRaysPerBlock, &packet);
  const VisitTable& table = *field.table;
  const std::array<std::int32_t, 3> strides = field.brick_strides;
  RaySums sums;
  /// Enters a voxel; false when the ray ends there.
  const auto visit = [&](Walker* w, unsigned code) {
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
      sums.proximity_steps += code >> kProximityShift;
      w->met_occplane = w->met_occplane || (code & kOccplaneBit) != 0;
    } else {
      w->run_entropy = 0;
    }
    w->visibility *= static_cast<double>(numbers.pass);
    return true;
  };
  for (std::size_t lane = 0; lane < kRaysPerBlock; ++lane) {
    if (packet.hits_region[lane] == 0) continue;
    Walker w;
    for (std::size_t a = 0; a < 3; ++a) {
      w.time[a] = packet.time[a][lane];
      w.period[a] = packet.period[a][lane];
      w.inverse[a] = 1 / static_cast<float>(w.period[a]);
      w.direction[a] = packet.direction[a][lane];
      w.voxel[a] = packet.voxel[a][lane];
    }
    bool alive = true;
    while (alive) {
      const std::array<std::int32_t, 3> brick = {w.voxel[0] >> 3, w.voxel[1] >> 3, w.voxel[2] >> 3};
      const std::uint32_t word = field.brick_words[field.first_brick_offset + brick[0] * strides[0] +
                                                   brick[1] * strides[1] + brick[2] * strides[2]];
      if ((word & FieldView::kUniformBrick) == 0) {
        const VisitCode* codes = field.brick_codes + static_cast<std::size_t>(word) * kEdge * kEdge * kEdge;
        bool inside = true;
        while (inside) {
          const auto i = static_cast<std::size_t>((w.voxel[0] & 7) | (w.voxel[1] & 7) << 3 | (w.voxel[2] & 7) << 6);
          alive = visit(&w, codes[i]);
          if (!alive) break;
          const std::size_t axis = w.next_axis();
          w.time[axis] += w.period[axis];
          w.voxel[axis] += w.direction[axis];
          inside = w.voxel[axis] >> 3 == brick[axis];
        }
        continue;
      }
      const int entry = static_cast<int>(word & kEntryMask);
      if (entry >= table.stop_begin) {
        alive = visit(&w, word & 0xffff);
        continue;
      }
      // q^k and 1 + q + ... + q^(k-1) by k visits.
      const VisitEntry& numbers = table.entry[word & kEntryMask];
      const std::int32_t visits = leave_brick(&w);
      const double q = static_cast<double>(numbers.pass), entropy = static_cast<double>(numbers.entropy);
      double power = 1, series = 0;
      for (std::int32_t k = 0; k < visits; ++k) {
        series += power;
        power *= q;
      }
      const double visible_entropy = w.visibility * entropy * series;
      sums.visits += visits;
      sums.entropy += entropy * visits;
      sums.occlusion_aware += visible_entropy;
      w.before_unknown = entry < table.unknown_end;
      w.run_entropy = w.before_unknown ? w.run_entropy + visible_entropy : 0;
      if (w.before_unknown) sums.unobserved_voxel += visible_entropy;
      w.visibility *= power;
    }
    sums.ends_occplane += w.met_occplane;
  }
  return sums;
}

}  // namespace vantage
