#pragma once

#include <cstdint>
#include <string>

#include "drivers/can/object_table.h"
#include "drivers/sim/drive_dictionary.h"

namespace vantage::sim {

/// Objects of the maker's own: how a test or a person makes a simulated drive fail, over the bus.
inline constexpr can::ObjectAddress kAxisLabel{0x2000, 0};    ///< a text that can be written
inline constexpr can::ObjectAddress kTripObject{0x2F00, 0};   ///< written: the drive faults with this code of 603F
inline constexpr can::ObjectAddress kBlockObject{0x2F01, 0};  ///< 1: the motor is blocked
inline constexpr can::ObjectAddress kSilentObject{0x2F02,
                                                  0};  ///< 1: the drive's electronics hang: it says nothing more

/// All objects of a simulated drive, with their limits and the values they have after switching on: those of the
/// profiles' table, and its own. calib/rigs/simulated_drive.eds says the same.
void define_drive_objects(DriveDictionary* dictionary, std::uint8_t node, const std::string& label);

}  // namespace vantage::sim
