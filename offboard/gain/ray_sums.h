#pragma once

#include <cstdint>

namespace vantage {

/// What the rays of a view met, summed over rays: all that the formulations are made of.
struct RaySums {
  std::int64_t rays = 0;              ///< cast, those that miss the region included
  std::int64_t visits = 0;            ///< voxels traversed, the occupied ends included
  std::int64_t ends_occupied = 0;     ///< rays that met an occupied voxel, no occplane voxel before it
  std::int64_t ends_occplane = 0;     ///< rays that met an occplane voxel before any occupied one
  std::int64_t rear_side_voxels = 0;  ///< Eq. 7
  std::int64_t proximity_steps = 0;   ///< Eq. 9, in OccupancyMap::mark_step_m()
  double entropy = 0;                 ///< Eq. 2, nats
  double occlusion_aware = 0;         ///< Eqs. 3, 4
  double unobserved_voxel = 0;        ///< Eqs. 5, 6
  double rear_side_entropy = 0;       ///< Eq. 8

  RaySums& operator+=(const RaySums& other) {
    rays += other.rays;
    visits += other.visits;
    ends_occupied += other.ends_occupied;
    ends_occplane += other.ends_occplane;
    rear_side_voxels += other.rear_side_voxels;
    proximity_steps += other.proximity_steps;
    entropy += other.entropy;
    occlusion_aware += other.occlusion_aware;
    unobserved_voxel += other.unobserved_voxel;
    rear_side_entropy += other.rear_side_entropy;
    return *this;
  }
  bool operator==(const RaySums&) const = default;
};

}  // namespace vantage
