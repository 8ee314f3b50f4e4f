#pragma once

#include <cstdint>
#include <string>

namespace vantage::can {

/// Why a service data object was not transferred (CiA 301, table of abort codes).
enum class SdoAbort : std::uint32_t {
  kToggle = 0x05030000,
  kTimedOut = 0x05040000,
  kBadCommand = 0x05040001,
  kOutOfMemory = 0x05040005,
  kUnsupportedAccess = 0x06010000,
  kWriteOnly = 0x06010001,
  kReadOnly = 0x06010002,
  kNoObject = 0x06020000,
  kNotMappable = 0x06040041,
  kMappingTooLong = 0x06040042,
  kIncompatible = 0x06040043,
  kHardware = 0x06060000,
  kWrongLength = 0x06070010,
  kTooLong = 0x06070012,
  kTooShort = 0x06070013,
  kNoSubindex = 0x06090011,
  kBadValue = 0x06090030,
  kTooHigh = 0x06090031,
  kTooLow = 0x06090032,
  kGeneral = 0x08000000,
  kCannotStore = 0x08000020,
  kLocalControl = 0x08000021,
  kWrongState = 0x08000022
};

/// "value out of range (abort 0x06090030)".
std::string sdo_abort_text(std::uint32_t code);

}  // namespace vantage::can
