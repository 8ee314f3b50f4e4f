#pragma once

#include <string>

namespace vantage {

/// Inverse sensor model: how one depth measurement changes the volume. Defaults are the paper's (Section IV-A).
struct SensorModel {
  double hit_probability = 0.8;
  double miss_probability = 0.2;
  double clamp_min = 0.03;
  double clamp_max = 0.97;
  double max_range_m = 1.5;        ///< along the ray; a longer measurement frees up to here and hits nothing
  double occlusion_range_m = 0.3;  ///< d_max of Eq. 9
  /// Space counts as seen through up to this many standard deviations before the measured surface.
  double free_margin_sigmas = 2.0;

  /// False, with the reason in `why`: hit not in (0.5, 1), miss not in (0, 0.5), clamps that do not enclose both of
  /// them within (0, 1), a range that is not positive, a margin that is negative.
  bool valid(std::string* why = nullptr) const;

  bool operator==(const SensorModel&) const = default;
};

}  // namespace vantage
