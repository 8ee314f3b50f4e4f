#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "offboard/gain/formulation.h"
#include "offboard/gain/ray_bundle.h"
#include "offboard/gain/ray_sums.h"
#include "offboard/mapping/occupancy_map.h"

namespace vantage {

/// Information gain of one view by every formulation.
struct ViewGain {
  std::array<double, kFormulations> value{};
  RaySums sums;
  bool marks_missing = false;  ///< the map has no occlusion marks: formulations that need them are 0 for that reason
  std::string reason;          ///< why the view was not evaluated; empty when it was

  double operator[](Formulation f) const { return value[static_cast<std::size_t>(f)]; }
};

/// The formulations' values from a view's sums. `mark_step_m` as of the map.
ViewGain gain_of_sums(const RaySums& sums, double mark_step_m, const CombinedWeights& weights);

/// Eq. 10 over a view's other gains, as gain_of_sums adds them up: to the bit.
double combined_gain(const ViewGain& gain, const CombinedWeights& weights);

struct GainOptions {
  CombinedWeights weights;
  int threads = 1;
  /// By its name (cast_kernel.h), for tests and benchmarks; empty: the machine's best.
  std::string kernel;

  /// False, with the reason in `why`: weights that are not valid, threads not in [1, 256], a kernel
  /// that this machine has not.
  bool valid(std::string* why = nullptr) const;
};

/// Gain of one view for every formulation at once (Eqs. 2-10, 17-21).
///
/// Casts `rays` from `T_world_camera`, clips each to the map's region and walks it voxel by voxel to the first occupied
/// one, that included. Rays that miss the region contribute nothing but their number. A pose that is not finite or not
/// rigid gives an empty result with `reason` set.
/// \throws std::invalid_argument when the options are not valid.
ViewGain evaluate_view(const OccupancyMap& map, const RayBundle& rays, const Eigen::Isometry3d& T_world_camera,
                       const GainOptions& options = {});

/// The same for many views, in their order. The result does not depend on the number of threads.
std::vector<ViewGain> evaluate_views(const OccupancyMap& map, const RayBundle& rays,
                                     std::span<const Eigen::Isometry3d> T_world_cameras,
                                     const GainOptions& options = {});

}  // namespace vantage
