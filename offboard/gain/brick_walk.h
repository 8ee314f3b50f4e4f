#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "offboard/gain/cast_block.h"

namespace vantage {

/// How many of the crossings at time, time + period, ... come before `end`, or, with `ties`, not after it.
static inline std::int32_t crossings_before(std::int32_t end, bool ties, std::int32_t time, std::int32_t period,
                                            float inverse) {
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

/// A ray in flight, in the fixed point of ray_packet.h.
struct BrickWalker {
  std::array<std::int32_t, 3> time, period, direction, voxel;
  std::array<float, 3> inverse;  // 1 / period

  static BrickWalker of(const RayPacket<kRaysPerBlock>& packet, std::size_t lane) {
    BrickWalker w;
    for (std::size_t a = 0; a < 3; ++a) {
      w.time[a] = packet.time[a][lane];
      w.period[a] = packet.period[a][lane];
      w.inverse[a] = 1 / static_cast<float>(w.period[a]);
      w.direction[a] = packet.direction[a][lane];
      w.voxel[a] = packet.voxel[a][lane];
    }
    return w;
  }

  std::size_t next_axis() const {
    return time[0] <= time[1] ? (time[0] <= time[2] ? 0U : 2U) : (time[1] <= time[2] ? 1U : 2U);
  }
};

/// Leaves the cube of that edge (voxels, a power of two) at a multiple of it, in one step; the number of its voxels
/// that were met, the present one included.
static inline std::int32_t leave_cube(BrickWalker* w, std::int32_t edge) {
  std::array<std::int32_t, 3> ahead, exit;  // faces to cross to be out of the cube along each axis; when
  for (std::size_t a = 0; a < 3; ++a) {
    const std::int32_t in_cube = w->voxel[a] & (edge - 1);
    ahead[a] = w->direction[a] > 0 ? edge - in_cube : in_cube + 1;
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

}  // namespace vantage
