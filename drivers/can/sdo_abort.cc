#include "drivers/can/sdo_abort.h"

#include <cstdio>

namespace vantage::can {
namespace {

const char* words_of(std::uint32_t code) {
  switch (static_cast<SdoAbort>(code)) {
    case SdoAbort::kToggle:
      return "segments out of turn (toggle bit)";
    case SdoAbort::kTimedOut:
      return "no answer in time";
    case SdoAbort::kBadCommand:
      return "unknown command";
    case SdoAbort::kOutOfMemory:
      return "out of memory";
    case SdoAbort::kUnsupportedAccess:
      return "this kind of access is not supported";
    case SdoAbort::kWriteOnly:
      return "the object can only be written";
    case SdoAbort::kReadOnly:
      return "the object can only be read";
    case SdoAbort::kNoObject:
      return "the drive has no such object";
    case SdoAbort::kNotMappable:
      return "the object can't be mapped into a PDO";
    case SdoAbort::kMappingTooLong:
      return "the mapped objects are longer than a PDO";
    case SdoAbort::kIncompatible:
      return "incompatible parameters";
    case SdoAbort::kHardware:
      return "the drive's hardware failed";
    case SdoAbort::kWrongLength:
      return "the value's length does not fit the object";
    case SdoAbort::kTooLong:
      return "the value is longer than the object";
    case SdoAbort::kTooShort:
      return "the value is shorter than the object";
    case SdoAbort::kNoSubindex:
      return "the object has no such subindex";
    case SdoAbort::kBadValue:
      return "value out of range";
    case SdoAbort::kTooHigh:
      return "value too high";
    case SdoAbort::kTooLow:
      return "value too low";
    case SdoAbort::kGeneral:
      return "general error";
    case SdoAbort::kCannotStore:
      return "the value can't be stored";
    case SdoAbort::kLocalControl:
      return "the drive is under local control";
    case SdoAbort::kWrongState:
      return "not allowed in the drive's present state";
  }
  return "a reason of the maker's own";
}

}  // namespace

std::string sdo_abort_text(std::uint32_t code) {
  char number[32];
  std::snprintf(number, sizeof number, " (abort 0x%08X)", code);
  return std::string(words_of(code)) + number;
}

}  // namespace vantage::can
