#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

#include "drivers/can/canopen_master.h"
#include "drivers/can/cia402.h"
#include "drivers/can/object_table.h"

namespace vantage::can {

/// How a drive finds its zero (6098, 6099, 609A, 607C). Speeds in increments/s.
struct HomingSetup {
  int method = 0;  ///< as CiA 402 numbers them: 17 negative limit switch, 18 positive one, 37 the present position
  std::uint32_t switch_speed = 0, zero_speed = 0;
  std::uint32_t acceleration = 0;
  std::int32_t offset = 0;
};

/// All that a drive is told before it may move. Positions in encoder increments, speeds in increments/s.
struct DriveSetup {
  std::string name;
  std::uint8_t node = 0;
  DriveMode mode = DriveMode::kCyclicPosition;
  std::chrono::milliseconds cycle{10};
  std::uint8_t master_node = kLastNode;
  std::chrono::milliseconds master_timeout{100};   ///< silence of the master after which the drive stops by itself
  std::chrono::milliseconds heartbeat_period{50};  ///< of the drive's own heartbeat
  std::uint32_t encoder_increments = 4000;         ///< of one motor turn
  std::uint32_t quick_stop_deceleration = 0;       ///< increments/s2
  std::uint32_t profile_speed = 0, profile_acceleration = 0;
  std::uint32_t following_error_window = 0;
  std::chrono::milliseconds following_error_time{20};
  std::optional<std::int32_t> lowest_position, highest_position;
  HomingSetup homing;
  ObjectMap objects = profile_objects();  ///< corrected by the drive's EDS
  std::uint32_t vendor = 0, product = 0;  ///< expected in 1018; 0: any
};

/// PDO 1 to the drive: controlword and target; PDO 1 from it: statusword and actual position.
inline constexpr int kCyclicPdo = 1;
PdoConfig command_pdo(DriveMode mode);
PdoConfig feedback_pdo();
constexpr std::size_t kCyclicPdoBytes = 6;

/// Sets a drive up, from pre-operational to operational: identity, supported modes, heartbeats both ways, what it does
/// when the master is lost (6007: quick stop), scaling, limits, homing, cycle time, PDOs, mode. Everything written is
/// read back and compared. Sends no controlword: the drive stays without power.
///
/// Returns the first fault, "joint_3 (node 3): writing 6065 (following error window): value too high (abort 0x…)";
/// empty when all is as it should be. Bounded in time by the master's SDO time-out for each object.
std::string set_up_drive(CanopenMaster& master, const DriveSetup& setup);

/// Changes 6060 and waits until 6061 follows, at most half a second. Empty, or the fault.
std::string change_mode(CanopenMaster& master, const DriveSetup& setup, DriveMode mode);

}  // namespace vantage::can
