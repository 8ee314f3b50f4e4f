#include "drivers/can/emergency.h"

#include <array>
#include <cstdio>

namespace vantage::can {
namespace {

struct ErrorClass {
  std::uint16_t code, mask;
  const char* words;
};

// The first that fits counts: from the exact code to its class.
constexpr std::array kErrors{
    ErrorClass{0x0000, 0xFFFF, "no error"},
    ErrorClass{0x2310, 0xFFFF, "continuous over-current"},
    ErrorClass{0x2320, 0xFFFF, "short circuit"},
    ErrorClass{0x3210, 0xFFFF, "over-voltage of the supply"},
    ErrorClass{0x3220, 0xFFFF, "under-voltage of the supply"},
    ErrorClass{0x4310, 0xFFFF, "the drive is too hot"},
    ErrorClass{0x5441, 0xFFFF, "emergency stop contact open"},
    ErrorClass{0x6320, 0xFFFF, "a parameter is wrong"},
    ErrorClass{0x7121, 0xFFFF, "the motor is blocked"},
    ErrorClass{0x7305, 0xFFFF, "incremental encoder failed"},
    ErrorClass{0x7380, 0xFFFF, "position sensor failed"},
    ErrorClass{0x8110, 0xFFFF, "CAN overrun: frames were lost"},
    ErrorClass{0x8120, 0xFFFF, "CAN error passive"},
    ErrorClass{0x8130, 0xFFFF, "the master's heartbeat was lost"},
    ErrorClass{0x8140, 0xFFFF, "back from bus-off"},
    ErrorClass{0x8210, 0xFFFF, "a PDO was too short"},
    ErrorClass{0x8611, 0xFFFF, "following error too large"},
    ErrorClass{0x8612, 0xFFFF, "reference limit reached"},
    ErrorClass{0x1000, 0xFF00, "general error"},
    ErrorClass{0x2000, 0xF000, "a fault of the current"},
    ErrorClass{0x3000, 0xF000, "a fault of the voltage"},
    ErrorClass{0x4000, 0xF000, "a fault of the temperature"},
    ErrorClass{0x5000, 0xF000, "a fault of the drive's hardware"},
    ErrorClass{0x6000, 0xF000, "a fault of the drive's software"},
    ErrorClass{0x7000, 0xF000, "a fault of an added module"},
    ErrorClass{0x8100, 0xFF00, "a fault of communication"},
    ErrorClass{0x8200, 0xFF00, "a fault of the protocol"},
    ErrorClass{0x8600, 0xFF00, "a fault of the position control"},
    ErrorClass{0x8000, 0xF000, "a fault of the supervision"},
};

}  // namespace

bool read_emergency(const CanFrame& frame, Emergency* emergency) {
  if (frame.error || frame.remote || frame.size != 8) return false;
  emergency->error_code = static_cast<std::uint16_t>(frame.data[0] | frame.data[1] << 8);
  emergency->error_register = frame.data[2];
  return true;
}

std::string error_code_text(std::uint16_t code) {
  const char* words = "an error of the maker's own";
  for (const ErrorClass& error : kErrors) {
    if ((code & error.mask) != error.code) continue;
    words = error.words;
    break;
  }
  char text[16];
  std::snprintf(text, sizeof text, "0x%04X", code);
  return std::string("error ") + text + ": " + words;
}

}  // namespace vantage::can
