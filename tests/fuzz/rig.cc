#include "calib/rig.h"

#include <cmath>
#include <cstdlib>
#include <string>
#include <string_view>

#include "calib/files/input_error.h"
#include "targets.h"

namespace vantage::fuzz {

void rig(Bytes input) {
  const std::string text(reinterpret_cast<const char*>(input.data()), input.size());
  try {
    const Rig rig = parse_rig(text, "fuzz.yaml");
    if (!rig.camera.valid() || !(rig.linear_speed_limit_m_s > 0)) std::abort();
    if (!rig.drives) return;
    for (const JointRig& joint : rig.drives->joints) {
      if (!(joint.lower_rad < joint.upper_rad) || !std::isfinite(joint.drive.increments_per_rad())) std::abort();
    }
  } catch (const InputError& error) {
    const std::string_view what = error.what();
    if (!what.starts_with("fuzz.yaml:")) std::abort();
  }
}

}  // namespace vantage::fuzz
