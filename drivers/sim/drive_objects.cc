#include "drivers/sim/drive_objects.h"

#include <algorithm>
#include <utility>

#include "drivers/can/cia402.h"
#include "drivers/can/emergency.h"
#include "drivers/can/nmt.h"
#include "drivers/can/pdo.h"

namespace vantage::sim {
namespace {

using can::DriveMode;
using can::ObjectAddress;
using can::PdoDirection;
namespace objects = can::objects;

}  // namespace

void define_drive_objects(DriveDictionary* dictionary, std::uint8_t node, const std::string& label) {
  for (const auto& [address, entry] : can::profile_objects()) {
    if (can::size_of(entry.type) > 0) dictionary->define(address, entry);
  }
  const auto limit = [dictionary](ObjectAddress address, std::int64_t low, std::int64_t high) {
    can::ObjectEntry entry = can::profile_objects().at(address);
    entry.low_limit = low;
    entry.high_limit = high;
    dictionary->define(address, entry, std::clamp<std::int64_t>(dictionary->get(address), low, high));
  };
  limit(objects::kHighestSpeed, 1, 2'000'000);
  limit(objects::kProfileSpeed, 1, 2'000'000);
  limit(objects::kProfileAcceleration, 1, 50'000'000);
  limit(objects::kProfileDeceleration, 1, 50'000'000);
  limit(objects::kQuickStopDeceleration, 1, 50'000'000);
  limit(objects::kFollowingErrorWindow, 1, 4'000'000);
  limit(objects::kHomingMethod, 0, 37);
  limit(objects::kConnectionLossReaction, 0, 3);
  limit(objects::kQuickStopReaction, 0, 8);
  limit(objects::kEncoderIncrements, 1, 1'000'000);
  dictionary->define_text(objects::kDeviceName, "device name", "Vantage simulated drive", false);
  dictionary->define_text(kAxisLabel, "axis label", label, true);
  using enum can::DataType;
  dictionary->define(kTripObject, {"fault on demand", kUnsigned16, true, {}, {}, {}});
  dictionary->define(kBlockObject, {"blocked motor", kUnsigned8, true, 0, 1, {}});
  dictionary->define(kSilentObject, {"hanging electronics", kUnsigned8, true, 0, 1, {}});

  const std::pair<ObjectAddress, std::int64_t> values[] = {
      {objects::kDeviceType, 0x0002'0000 | 402},
      {{0x1005, 0}, can::kSyncId},
      {{0x1014, 0}, can::emergency_id(node)},
      {{0x1016, 0}, 1},
      {{0x1018, 0}, 4},
      {objects::kVendor, 0x56414E54},  // "VANT"
      {objects::kProduct, 1},
      {objects::kRevision, 1},
      {objects::kSerial, node},
      {objects::kQuickStopReaction, 2},
      {objects::kConnectionLossReaction, 1},
      {objects::kFollowingErrorWindow, 4000},
      {objects::kFollowingErrorTime, 20},
      {{0x607D, 0}, 2},
      {objects::kHighestSpeed, 400'000},
      {objects::kProfileSpeed, 20'000},
      {objects::kProfileAcceleration, 100'000},
      {objects::kProfileDeceleration, 100'000},
      {objects::kQuickStopDeceleration, 1'000'000},
      {{0x608F, 0}, 2},
      {objects::kEncoderIncrements, 4000},
      {objects::kEncoderTurns, 1},
      {{0x6091, 0}, 2},
      {objects::kGearMotorTurns, 1},
      {objects::kGearShaftTurns, 1},
      {objects::kHomingMethod, 35},
      {{0x6099, 0}, 2},
      {objects::kHomingSwitchSpeed, 10'000},
      {objects::kHomingZeroSpeed, 2'000},
      {objects::kHomingAcceleration, 100'000},
      {{0x60C2, 0}, 2},
      {objects::kCyclePeriod, 10},
      {objects::kCycleExponent, -3},
      {objects::kSupportedModes, can::mode_bit(DriveMode::kProfilePosition) |
                                     can::mode_bit(DriveMode::kProfileVelocity) | can::mode_bit(DriveMode::kHoming) |
                                     can::mode_bit(DriveMode::kCyclicPosition) |
                                     can::mode_bit(DriveMode::kCyclicVelocity)},
  };
  for (const auto& [address, value] : values) dictionary->set(address, value);
  for (const PdoDirection direction : {PdoDirection::kToDrive, PdoDirection::kFromDrive}) {
    for (int pdo = 1; pdo <= 4; ++pdo) {
      const std::uint16_t parameters = can::pdo_parameters(direction, pdo);
      dictionary->set({parameters, 0}, 2);
      dictionary->set({parameters, 1}, can::pdo_id(direction, pdo, node) | (pdo > 1 ? can::kPdoInvalid : 0U));
      dictionary->set({parameters, 2}, 255);
      const std::uint16_t mapping = can::pdo_mapping(direction, pdo);
      dictionary->set({mapping, 0}, 1);
      dictionary->set({mapping, 1}, direction == PdoDirection::kToDrive ? 0x6040'0010 : 0x6041'0010);
    }
  }
}

}  // namespace vantage::sim
