#include "offboard/mapping/sensor_model.h"

#include <cmath>

namespace vantage {

bool SensorModel::valid(std::string* why) const {
  const auto fail = [why](const char* reason) {
    if (why != nullptr) *why = reason;
    return false;
  };
  if (!(hit_probability > 0.5 && hit_probability < 1)) return fail("hit_probability must lie between 0.5 and 1");
  if (!(miss_probability > 0 && miss_probability < 0.5)) return fail("miss_probability must lie between 0 and 0.5");
  if (!(clamp_min > 0 && clamp_min <= miss_probability)) {
    return fail("clamp_min must be positive and at most miss_probability");
  }
  if (!(clamp_max < 1 && clamp_max >= hit_probability)) {
    return fail("clamp_max must be less than 1 and at least hit_probability");
  }
  if (!(std::isfinite(max_range_m) && max_range_m > 0)) return fail("max_range_m must be finite and positive");
  if (!(std::isfinite(occlusion_range_m) && occlusion_range_m > 0)) {
    return fail("occlusion_range_m must be finite and positive");
  }
  if (!(std::isfinite(free_margin_sigmas) && free_margin_sigmas >= 0)) {
    return fail("free_margin_sigmas must be finite and not negative");
  }
  return true;
}

}  // namespace vantage
