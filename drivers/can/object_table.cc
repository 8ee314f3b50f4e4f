#include "drivers/can/object_table.h"

#include <cstdio>

namespace vantage::can {

int size_of(DataType type) {
  switch (type) {
    case DataType::kBoolean:
    case DataType::kInteger8:
    case DataType::kUnsigned8:
      return 1;
    case DataType::kInteger16:
    case DataType::kUnsigned16:
      return 2;
    case DataType::kInteger32:
    case DataType::kUnsigned32:
      return 4;
    case DataType::kVisibleString:
    case DataType::kOctetString:
    case DataType::kDomain:
      break;
  }
  return 0;
}

bool is_signed(DataType type) {
  return type == DataType::kInteger8 || type == DataType::kInteger16 || type == DataType::kInteger32;
}

const ObjectMap& profile_objects() {
  using enum DataType;
  using namespace objects;
  const auto read = [](const char* name, DataType type) { return ObjectEntry{name, type, false, {}, {}, {}}; };
  const auto write = [](const char* name, DataType type) { return ObjectEntry{name, type, true, {}, {}, {}}; };
  static const ObjectMap table = [&] {
    ObjectMap map{
        {kDeviceType, read("device type", kUnsigned32)},
        {kErrorRegister, read("error register", kUnsigned8)},
        {{0x1003, 0}, write("number of errors", kUnsigned8)},
        {kErrorHistory, read("last error", kUnsigned32)},
        {{0x1005, 0}, write("SYNC identifier", kUnsigned32)},
        {kDeviceName, read("device name", kVisibleString)},
        {{0x1014, 0}, write("EMCY identifier", kUnsigned32)},
        {{0x1016, 0}, read("number of heartbeats watched", kUnsigned8)},
        {kMasterHeartbeat, write("watched heartbeat", kUnsigned32)},
        {kProducerHeartbeat, write("producer heartbeat time", kUnsigned16)},
        {{0x1018, 0}, read("identity entries", kUnsigned8)},
        {kVendor, read("vendor", kUnsigned32)},
        {kProduct, read("product", kUnsigned32)},
        {kRevision, read("revision", kUnsigned32)},
        {kSerial, read("serial number", kUnsigned32)},
        {kConnectionLossReaction, write("reaction to a lost master", kInteger16)},
        {kErrorCode, read("error code", kUnsigned16)},
        {kControlword, write("controlword", kUnsigned16)},
        {kStatusword, read("statusword", kUnsigned16)},
        {kQuickStopReaction, write("quick-stop reaction", kInteger16)},
        {kMode, write("mode of operation", kInteger8)},
        {kModeDisplay, read("mode in force", kInteger8)},
        {kActualPosition, read("actual position", kInteger32)},
        {kFollowingErrorWindow, write("following error window", kUnsigned32)},
        {kFollowingErrorTime, write("following error time", kUnsigned16)},
        {kActualVelocity, read("actual velocity", kInteger32)},
        {kTargetPosition, write("target position", kInteger32)},
        {kHomeOffset, write("home offset", kInteger32)},
        {{0x607D, 0}, read("position limits", kUnsigned8)},
        {kLowestPosition, write("lowest position", kInteger32)},
        {kHighestPosition, write("highest position", kInteger32)},
        {kHighestSpeed, write("highest speed", kUnsigned32)},
        {kProfileSpeed, write("profile speed", kUnsigned32)},
        {kProfileAcceleration, write("profile acceleration", kUnsigned32)},
        {kProfileDeceleration, write("profile deceleration", kUnsigned32)},
        {kQuickStopDeceleration, write("quick-stop deceleration", kUnsigned32)},
        {{0x608F, 0}, read("encoder resolution", kUnsigned8)},
        {kEncoderIncrements, write("encoder increments", kUnsigned32)},
        {kEncoderTurns, write("motor turns of the increments", kUnsigned32)},
        {{0x6091, 0}, read("gear ratio", kUnsigned8)},
        {kGearMotorTurns, write("gear: motor turns", kUnsigned32)},
        {kGearShaftTurns, write("gear: shaft turns", kUnsigned32)},
        {kHomingMethod, write("homing method", kInteger8)},
        {{0x6099, 0}, read("homing speeds", kUnsigned8)},
        {kHomingSwitchSpeed, write("speed towards the switch", kUnsigned32)},
        {kHomingZeroSpeed, write("speed towards zero", kUnsigned32)},
        {kHomingAcceleration, write("homing acceleration", kUnsigned32)},
        {{0x60C2, 0}, read("cycle time", kUnsigned8)},
        {kCyclePeriod, write("cycle time, number", kUnsigned8)},
        {kCycleExponent, write("cycle time, power of ten", kInteger8)},
        {kFollowingError, read("following error", kInteger32)},
        {kTargetVelocity, write("target velocity", kInteger32)},
        {kSupportedModes, read("supported modes", kUnsigned32)},
    };
    for (std::uint16_t pdo = 0; pdo < 4; ++pdo) {
      for (const std::uint16_t base : {std::uint16_t{0x1400}, std::uint16_t{0x1800}}) {
        const auto index = static_cast<std::uint16_t>(base + pdo);
        map[{index, 0}] = read("PDO parameters", kUnsigned8);
        map[{index, 1}] = write("PDO identifier", kUnsigned32);
        map[{index, 2}] = write("PDO transmission type", kUnsigned8);
      }
      for (const std::uint16_t base : {std::uint16_t{0x1600}, std::uint16_t{0x1A00}}) {
        const auto index = static_cast<std::uint16_t>(base + pdo);
        map[{index, 0}] = write("PDO mapping, number of entries", kUnsigned8);
        for (std::uint8_t sub = 1; sub <= 8; ++sub) map[{index, sub}] = write("PDO mapping entry", kUnsigned32);
      }
    }
    return map;
  }();
  return table;
}

ObjectMap corrected_by(const ObjectMap& base, const ObjectMap& eds) {
  ObjectMap corrected = eds;
  corrected.insert(base.begin(), base.end());  // keeps what the EDS has
  return corrected;
}

std::string to_text(const ObjectAddress& address, const ObjectMap& objects) {
  char text[16];
  if (address.sub == 0) {
    std::snprintf(text, sizeof text, "%04X", address.index);
  } else {
    std::snprintf(text, sizeof text, "%04X:%X", address.index, address.sub);
  }
  const auto found = objects.find(address);
  return found == objects.end() ? std::string(text) : text + (" (" + found->second.name + ")");
}

}  // namespace vantage::can
