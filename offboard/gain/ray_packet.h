#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace vantage {

/// Where rays start and which way they go, on the grid, in integers.
///
/// The walk is Amanatides and Woo's in 32-bit fixed point. Times run along the ray from its entry into the region, in
/// `GridWalk::time_scale` a voxel's edge; `time[a]` is when it crosses its next face along axis a, `period[a]` the time
/// between faces. Integer sums have no rounding, so every kernel visits the same voxels, and k steps at once are k
/// steps one by one. The resolution is 2^-22 of a voxel at 128 voxels (2^-19 at 1024): after crossing the region a ray
/// has strayed by less than 1/10000 voxel (1/1000).
template <int kLanes>
struct alignas(64) RayPacket {
  std::array<std::array<std::int32_t, kLanes>, 3> time, period;
  std::array<std::array<std::int32_t, kLanes>, 3> voxel;      ///< first voxel
  std::array<std::array<std::int32_t, kLanes>, 3> direction;  ///< +1 or -1
  std::array<std::int32_t, kLanes> hits_region;               ///< 0: the ray misses the region
};

/// The region as the walk sees it, and a view's sensor in it.
struct GridWalk {
  std::array<int, 3> size{};         ///< voxels
  double time_scale = 0;             ///< fixed-point units in a voxel's edge
  std::array<double, 3> origin{};    ///< of all rays of the view, voxels
  std::array<double, 9> rotation{};  ///< world from camera, row-major

  static constexpr double kMaxTime = 1073741823;  // 2^30 - 1: time + period stays below 2^31

  /// Largest power of two at which the longest way through the region stays below kMaxTime.
  static double time_scale_of(double diagonal_voxels) {
    double scale = 1;
    while (2 * scale * (diagonal_voxels + 2) < kMaxTime) scale *= 2;
    return scale;
  }
};

/// Directions of a bundle as three columns, padded to a multiple of the block.
struct RayColumns {
  const double *x = nullptr, *y = nullptr, *z = nullptr;
  std::size_t size = 0;  ///< without padding
};

/// Prepares rays [first, first + kLanes) of the bundle. To be compiled without contraction of a * b + c, so that every
/// instruction set gives the same integers. Lanes at or past `columns.size` miss the region.
/// Static: every kernel's file must keep its own, as the linker may keep any one of several inline copies.
template <int kLanes>
static inline void prepare_packet(const GridWalk& walk, const RayColumns& columns, std::size_t first,
                                  RayPacket<kLanes>* packet) {
  std::array<std::array<double, kLanes>, 3> direction, inverse;
  std::array<double, kLanes> enter, leave;
  const double* cx = columns.x + first;
  const double* cy = columns.y + first;
  const double* cz = columns.z + first;
  for (std::size_t i = 0; i < kLanes; ++i) {
    enter[i] = 0;
    leave[i] = 1e30;
  }
  for (std::size_t a = 0; a < 3; ++a) {
    const double r0 = walk.rotation[3 * a], r1 = walk.rotation[3 * a + 1], r2 = walk.rotation[3 * a + 2];
    const double origin = walk.origin[a], far = walk.size[a];
    for (std::size_t i = 0; i < kLanes; ++i) {
      double d = r0 * cx[i] + r1 * cy[i] + r2 * cz[i];
      // A ray along a face plane never crosses it within kMaxTime, whatever the tiny number.
      d = std::abs(d) < 1e-15 ? 1e-15 : d;
      direction[a][i] = d;
      inverse[a][i] = 1 / d;
      const double near_time = (0 - origin) * inverse[a][i], far_time = (far - origin) * inverse[a][i];
      const double first_time = near_time < far_time ? near_time : far_time;
      const double last_time = near_time < far_time ? far_time : near_time;
      enter[i] = enter[i] > first_time ? enter[i] : first_time;
      leave[i] = leave[i] < last_time ? leave[i] : last_time;
    }
  }
  for (std::size_t i = 0; i < kLanes; ++i) packet->hits_region[i] = enter[i] < leave[i] && first + i < columns.size;
  for (std::size_t a = 0; a < 3; ++a) {
    const double origin = walk.origin[a], last = walk.size[a] - 1;
    for (std::size_t i = 0; i < kLanes; ++i) {
      const double d = direction[a][i];
      double start = origin + enter[i] * d;
      start = start > 0 ? start : 0;  // also for rays that miss
      start = start < last ? start : last + 0.5;
      const auto voxel = static_cast<std::int32_t>(start);
      const double face = static_cast<double>(voxel) + (d > 0 ? 1 : 0);
      double time = ((face - origin) * inverse[a][i] - enter[i]) * walk.time_scale;
      double period = std::abs(inverse[a][i]) * walk.time_scale;
      time = time > 0 ? time : 0;
      time = time < GridWalk::kMaxTime ? time : GridWalk::kMaxTime;
      period = period < GridWalk::kMaxTime ? period : GridWalk::kMaxTime;
      packet->voxel[a][i] = voxel;
      packet->direction[a][i] = d > 0 ? 1 : -1;
      packet->time[a][i] = static_cast<std::int32_t>(time + 0.5);
      packet->period[a][i] = static_cast<std::int32_t>(period + 0.5);
    }
  }
}

}  // namespace vantage
