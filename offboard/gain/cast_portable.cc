// Four rays at once in the compiler's own vectors: SSE2 on any x86-64, NEON on any 64-bit ARM.

#include <cstring>

#include "offboard/gain/cast_block.h"

namespace vantage {
namespace {

constexpr std::size_t kLanes = 4;
using Ints = std::int32_t __attribute__((vector_size(16)));
using Floats = float __attribute__((vector_size(16)));
using Longs = std::int64_t __attribute__((vector_size(16)));

Ints load(const std::int32_t* from) {
  Ints value;
  std::memcpy(&value, from, sizeof value);
  return value;
}

Floats load(const float* from) {
  Floats value;
  std::memcpy(&value, from, sizeof value);
  return value;
}

bool any_negative(Ints value) {
  const Longs pairs = reinterpret_cast<Longs>(value);
  return ((pairs[0] | pairs[1]) & static_cast<std::int64_t>(0x8000000080000000)) != 0;
}

double sum(Floats value) {
  return static_cast<double>(value[0]) + static_cast<double>(value[1]) + static_cast<double>(value[2]) +
         static_cast<double>(value[3]);
}

/// Four rays on their way.
struct Walkers {
  Ints time_x, time_y, time_z, period_x, period_y, period_z, step_x, step_y, step_z, at;
};

void cast_four(const FieldView& field, const RayPacket<kRaysPerBlock>& packet, std::size_t first, RaySums* sums) {
  const VisitCode* codes = field.codes;
  const VisitEntry* table = field.table->entry.data();
  const auto sentinel = static_cast<unsigned>(field.table->sentinel());
  const std::array<std::int32_t, 3> strides = field.strides;
  Walkers w{load(&packet.time[0][first]),
            load(&packet.time[1][first]),
            load(&packet.time[2][first]),
            load(&packet.period[0][first]),
            load(&packet.period[1][first]),
            load(&packet.period[2][first]),
            load(&packet.direction[0][first]) * strides[0],
            load(&packet.direction[1][first]) * strides[1],
            load(&packet.direction[2][first]) * strides[2],
            field.first_offset + load(&packet.voxel[0][first]) * strides[0] +
                load(&packet.voxel[1][first]) * strides[1] + load(&packet.voxel[2][first]) * strides[2]};
  int alive = 0;
  const auto park = [&](int lane) {
    w.step_x[lane] = w.step_y[lane] = w.step_z[lane] = 0;
    w.period_x[lane] = w.period_y[lane] = w.period_z[lane] = 0;
    w.at[lane] = field.parked_offset;
  };
  for (int lane = 0; lane < static_cast<int>(kLanes); ++lane) {
    if (packet.hits_region[first + static_cast<std::size_t>(lane)] == 0) {
      park(lane);
    } else {
      ++alive;
    }
  }
  const Floats zero{};
  Floats visibility = zero + 1, entropy = zero, occlusion_aware = zero, unobserved = zero, run = zero;
  float rear_side_entropy = 0;
  Ints before = {}, occplane = {};
  std::int64_t proximity = 0;
  for (std::int64_t visit = 1; alive > 0; ++visit) {
    const unsigned c0 = codes[w.at[0]], c1 = codes[w.at[1]], c2 = codes[w.at[2]], c3 = codes[w.at[3]];
    const Floats e0 = load(&table[c0 & 0xff].pass), e1 = load(&table[c1 & 0xff].pass);
    const Floats e2 = load(&table[c2 & 0xff].pass), e3 = load(&table[c3 & 0xff].pass);
    if ((c0 | c1 | c2 | c3) > 0x7f) {
      proximity +=
          (c0 >> kProximityShift) + (c1 >> kProximityShift) + (c2 >> kProximityShift) + (c3 >> kProximityShift);
      occplane |= Ints{static_cast<int>(c0), static_cast<int>(c1), static_cast<int>(c2), static_cast<int>(c3)};
    }
    // Four entries of (pass, entropy, unknown entropy, flags) become columns.
    const Floats low01 = __builtin_shuffle(e0, e1, Ints{0, 4, 1, 5}),
                 high01 = __builtin_shuffle(e0, e1, Ints{2, 6, 3, 7});
    const Floats low23 = __builtin_shuffle(e2, e3, Ints{0, 4, 1, 5}),
                 high23 = __builtin_shuffle(e2, e3, Ints{2, 6, 3, 7});
    const Floats pass = __builtin_shuffle(low01, low23, Ints{0, 1, 4, 5});
    const Floats voxel_entropy = __builtin_shuffle(low01, low23, Ints{2, 3, 6, 7});
    const Floats unknown_entropy = __builtin_shuffle(high01, high23, Ints{0, 1, 4, 5});
    const Ints flags = reinterpret_cast<Ints>(__builtin_shuffle(high01, high23, Ints{2, 3, 6, 7}));
    entropy += voxel_entropy;
    occlusion_aware += visibility * voxel_entropy;
    const Floats visible_unknown = visibility * unknown_entropy;
    unobserved += visible_unknown;
    visibility *= pass;
    if (any_negative(flags)) {
      for (int lane = 0; lane < static_cast<int>(kLanes); ++lane) {
        if (flags[lane] >= 0) continue;
        const unsigned code = codes[w.at[lane]] & kEntryMask;
        --alive;
        sums->visits += visit;
        if (code == sentinel) {
          --sums->visits;
        } else {
          sums->rear_side_voxels += before[lane] > 0;
          rear_side_entropy += run[lane];
          sums->ends_occupied += (occplane[lane] & static_cast<int>(kOccplaneBit)) == 0;
        }
        park(lane);
      }
    }
    run = reinterpret_cast<Floats>(reinterpret_cast<Ints>(run + visible_unknown) & flags);
    before = flags;
    const Ints x_after_y = w.time_x > w.time_y, x_after_z = w.time_x > w.time_z, y_after_z = w.time_y > w.time_z;
    const Ints go_x = ~(x_after_y | x_after_z), go_y = x_after_y & ~y_after_z, go_z = x_after_z & y_after_z;
    w.time_x += w.period_x & go_x;
    w.time_y += w.period_y & go_y;
    w.time_z += w.period_z & go_z;
    w.at += (w.step_x & go_x) + (w.step_y & go_y) + (w.step_z & go_z);
  }
  sums->proximity_steps += proximity;
  for (int lane = 0; lane < static_cast<int>(kLanes); ++lane) {
    sums->ends_occplane += (occplane[lane] & static_cast<int>(kOccplaneBit)) != 0;
  }
  sums->entropy += sum(entropy);
  sums->occlusion_aware += sum(occlusion_aware);
  sums->unobserved_voxel += sum(unobserved);
  sums->rear_side_entropy += static_cast<double>(rear_side_entropy);
}

}  // namespace

RaySums cast_flat_portable(const FieldView& field, const GridWalk& walk, const RayColumns& rays, std::size_t block) {
  RayPacket<kRaysPerBlock> packet;
  prepare_packet(walk, rays, block * kRaysPerBlock, &packet);
  RaySums sums;
  for (std::size_t first = 0; first < kRaysPerBlock; first += kLanes) cast_four(field, packet, first, &sums);
  return sums;
}

}  // namespace vantage
