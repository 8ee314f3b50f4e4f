#include "drivers/can/can_frame.h"

#include <algorithm>
#include <cstdlib>

#include "drivers/can/bus_error.h"
#include "drivers/can/emergency.h"
#include "targets.h"

namespace vantage::fuzz {

void can_frame(Bytes input) {
  while (!input.empty()) {
    const Bytes wire = input.first(std::min<std::size_t>(input.size(), can::kWireSize));
    input = input.subspan(wire.size());
    can::CanFrame frame;
    if (!can::read_wire(std::as_bytes(wire), &frame)) continue;
    // What was read is a frame, and is the same one after writing.
    can::CanFrame again;
    if (frame.size > 8 || !can::read_wire(can::write_wire(frame), &again) || !same_on_wire(frame, again)) std::abort();
    can::BusError error;
    if (can::read_bus_error(frame, &error) && to_text(error).empty()) std::abort();
    can::Emergency emergency;
    if (can::read_emergency(frame, &emergency) && can::error_code_text(emergency.error_code).empty()) std::abort();
  }
}

}  // namespace vantage::fuzz
