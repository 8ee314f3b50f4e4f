#pragma once

#include <cstdint>
#include <string>

#include "drivers/can/can_frame.h"

namespace vantage::can {

constexpr std::uint32_t emergency_id(std::uint8_t node) { return 0x080U + node; }

/// A drive's emergency message (EMCY).
struct Emergency {
  std::uint16_t error_code = 0;  ///< as 603F; 0: the error is over
  std::uint8_t error_register = 0;
};

/// False when the frame does not have an EMCY's eight bytes.
bool read_emergency(const CanFrame& frame, Emergency* emergency);

/// "error 0x8611: following error too large". The words are those of CiA 402's classes of 603F; a code of a drive's own
/// gets those of its class.
std::string error_code_text(std::uint16_t code);

}  // namespace vantage::can
