#include "drivers/can/eds.h"

#include <cstdlib>
#include <string_view>

#include "calib/files/input_error.h"
#include "targets.h"

namespace vantage::fuzz {

void eds(Bytes input) {
  const std::string_view text(reinterpret_cast<const char*>(input.data()), input.size());
  try {
    const can::Eds eds = can::parse_eds(text, "fuzz.eds", 5);
    for (const auto& [address, entry] : eds.objects) {
      if (entry.low_limit && entry.high_limit && *entry.low_limit > *entry.high_limit) std::abort();
      can::to_text(address, eds.objects);
    }
    can::corrected_by(can::profile_objects(), eds.objects);
  } catch (const InputError& error) {
    // One line that begins with the file.
    const std::string_view what = error.what();
    if (!what.starts_with("fuzz.eds:")) std::abort();
  }
}

}  // namespace vantage::fuzz
