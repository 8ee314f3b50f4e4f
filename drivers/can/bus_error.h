#pragma once

#include <cstdint>
#include <string>

#include "drivers/can/can_frame.h"

namespace vantage::can {

/// What an error frame of the controller says (linux/can/error.h).
struct BusError {
  bool transmit_timeout = false;
  bool lost_arbitration = false;
  bool no_acknowledge = false;                               ///< nobody else is on the bus, or its bit rate is another
  bool receive_overflow = false, transmit_overflow = false;  ///< in the controller
  bool warning = false, passive = false;                     ///< error counters above 96, above 127
  bool active_again = false;
  bool protocol_violation = false;
  bool bus_off = false;    ///< the controller has cut itself off and sends nothing more until it is restarted
  bool restarted = false;  ///< the controller is back; every node has to be set up again
  std::uint8_t transmit_errors = 0, receive_errors = 0;  ///< the controller's counters, where it tells them

  /// True when the bus can't be relied upon: bus-off, restarted, or nobody acknowledges.
  bool breaks_bus() const { return bus_off || restarted || no_acknowledge || transmit_timeout; }
};

/// False when the frame is not an error frame.
bool read_bus_error(const CanFrame& frame, BusError* error);

/// In words: "bus-off: the controller has cut itself off (transmit errors 248, receive errors 0)".
std::string to_text(const BusError& error);

}  // namespace vantage::can
