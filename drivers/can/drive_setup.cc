#include "drivers/can/drive_setup.h"

#include <vector>

namespace vantage::can {
namespace {

using std::chrono::milliseconds;
using std::chrono::nanoseconds;

constexpr std::uint32_t kDriveProfile = 402;     // low word of 1000
constexpr std::int64_t kQuickStopOnLoss = 3;     // 6007
constexpr std::int64_t kHoldAfterQuickStop = 6;  // 605A: by the quick stop ramp, then stay in quick stop
constexpr milliseconds kStatePatience{500}, kModePatience{500};

class Setup {
 public:
  Setup(CanopenMaster& master, const DriveSetup& setup) : master_(master), setup_(setup) {}

  std::string run() {
    master_.listen_to(setup_.node);
    if (!nmt(NmtCommand::kPreOperational)) return fault_;
    if (!check_identity() || !write_objects() || !set_up_pdos()) return fault_;
    if (std::string fault = change_mode(master_, setup_, setup_.mode); !fault.empty()) return fault;
    master_.forget(setup_.node);
    if (!nmt(NmtCommand::kStart) || !await_operational()) return fault_;
    return {};
  }

 private:
  bool fail(const std::string& fault) {
    fault_ = setup_.name + " (node " + std::to_string(setup_.node) + "): " + fault;
    return false;
  }

  bool nmt(NmtCommand command) { return master_.send_nmt(command, setup_.node) || fail(to_text(master_.bus_faults())); }

  bool read(ObjectAddress object, std::int64_t* value) {
    const SdoOutcome outcome = master_.read_number(setup_.node, object, value);
    return outcome.ok() || fail(outcome.fault);
  }

  bool write(ObjectAddress object, std::int64_t value) {
    const SdoOutcome outcome = master_.write_verified(setup_.node, object, value, setup_.objects);
    return outcome.ok() || fail(outcome.fault);
  }

  bool check_identity() {
    std::int64_t type = 0, modes = 0, vendor = 0, product = 0;
    if (!read(objects::kDeviceType, &type)) return false;
    if ((type & 0xFFFF) != kDriveProfile) {
      return fail("is no drive of CiA 402: its device type (1000) is of profile " + std::to_string(type & 0xFFFF));
    }
    if (!read(objects::kSupportedModes, &modes)) return false;
    if ((static_cast<std::uint32_t>(modes) & mode_bit(setup_.mode)) == 0) {
      return fail(std::string("does not support ") + to_text(setup_.mode) + " (6502)");
    }
    if (!read(objects::kVendor, &vendor) || !read(objects::kProduct, &product)) return false;
    if ((setup_.vendor != 0 && vendor != setup_.vendor) || (setup_.product != 0 && product != setup_.product)) {
      return fail("is vendor " + std::to_string(vendor) + ", product " + std::to_string(product) +
                  " (1018), but its EDS describes vendor " + std::to_string(setup_.vendor) + ", product " +
                  std::to_string(setup_.product));
    }
    return true;
  }

  bool write_objects() {
    using namespace objects;
    const std::int64_t watched = static_cast<std::int64_t>(setup_.master_node) << 16 | setup_.master_timeout.count();
    const bool basic =
        write(kMasterHeartbeat, watched) && write(kConnectionLossReaction, kQuickStopOnLoss) &&
        write(kProducerHeartbeat, setup_.heartbeat_period.count()) && write(kQuickStopReaction, kHoldAfterQuickStop) &&
        write(kQuickStopDeceleration, setup_.quick_stop_deceleration) &&
        write(kEncoderIncrements, setup_.encoder_increments) && write(kEncoderTurns, 1) && write(kGearMotorTurns, 1) &&
        write(kGearShaftTurns, 1) &&  // the rig's gear counts, not the drive's
        write(kFollowingErrorWindow, setup_.following_error_window) &&
        write(kFollowingErrorTime, setup_.following_error_time.count()) && write(kHighestSpeed, setup_.profile_speed) &&
        write(kProfileSpeed, setup_.profile_speed) && write(kProfileAcceleration, setup_.profile_acceleration) &&
        write(kProfileDeceleration, setup_.profile_acceleration) && write(kCyclePeriod, setup_.cycle.count()) &&
        write(kCycleExponent, -3);
    if (!basic) return false;
    if (setup_.lowest_position && !write(kLowestPosition, *setup_.lowest_position)) return false;
    if (setup_.highest_position && !write(kHighestPosition, *setup_.highest_position)) return false;
    if (setup_.homing.method == 0) return true;
    return write(kHomingMethod, setup_.homing.method) && write(kHomingSwitchSpeed, setup_.homing.switch_speed) &&
           write(kHomingZeroSpeed, setup_.homing.zero_speed) &&
           write(kHomingAcceleration, setup_.homing.acceleration) && write(kHomeOffset, setup_.homing.offset);
  }

  bool set_up_pdos() {
    for (const PdoConfig& config : {command_pdo(setup_.mode), feedback_pdo()}) {
      const SdoOutcome outcome = master_.set_up_pdo(setup_.node, config, setup_.objects);
      if (!outcome.ok()) return fail(outcome.fault);
    }
    for (const PdoDirection direction : {PdoDirection::kToDrive, PdoDirection::kFromDrive}) {
      for (int number = 2; number <= 4; ++number) {
        const SdoOutcome outcome = master_.switch_off_pdo(setup_.node, direction, number);
        if (!outcome.ok()) return fail(outcome.fault);
      }
    }
    return true;
  }

  bool await_operational() {
    const nanoseconds deadline = master_.clock().monotonic() + kStatePatience;
    while (!master_.node(setup_.node).heard || master_.node(setup_.node).state != NmtState::kOperational) {
      if (master_.clock().monotonic() >= deadline) {
        return fail(master_.node(setup_.node).heard
                        ? std::string("stays ") + to_text(master_.node(setup_.node).state) + " after NMT start"
                        : "sends no heartbeat");
      }
      master_.poll_until(std::min(deadline, master_.clock().monotonic() + milliseconds(5)));
    }
    return true;
  }

  CanopenMaster& master_;
  const DriveSetup& setup_;
  std::string fault_;
};

}  // namespace

PdoConfig command_pdo(DriveMode mode) {
  const bool velocity = mode == DriveMode::kCyclicVelocity || mode == DriveMode::kProfileVelocity;
  return {PdoDirection::kToDrive,
          kCyclicPdo,
          kEverySync,
          {{objects::kControlword, 2}, {velocity ? objects::kTargetVelocity : objects::kTargetPosition, 4}}};
}

PdoConfig feedback_pdo() {
  return {PdoDirection::kFromDrive, kCyclicPdo, kEverySync, {{objects::kStatusword, 2}, {objects::kActualPosition, 4}}};
}

std::string set_up_drive(CanopenMaster& master, const DriveSetup& setup) { return Setup(master, setup).run(); }

std::string change_mode(CanopenMaster& master, const DriveSetup& setup, DriveMode mode) {
  const std::string title = setup.name + " (node " + std::to_string(setup.node) + "): ";
  const SdoOutcome written =
      master.write_number(setup.node, objects::kMode, static_cast<std::int64_t>(mode), setup.objects);
  if (!written.ok()) return title + written.fault;
  const nanoseconds deadline = master.clock().monotonic() + kModePatience;
  std::int64_t shown = 0;
  while (true) {
    const SdoOutcome outcome = master.read_number(setup.node, objects::kModeDisplay, &shown);
    if (!outcome.ok()) return title + outcome.fault;
    if (shown == static_cast<std::int64_t>(mode)) return {};
    if (master.clock().monotonic() >= deadline) break;
    master.poll_until(master.clock().monotonic() + milliseconds(5));
  }
  return title + "does not go into " + to_text(mode) + ": 6061 (mode in force) stays " + std::to_string(shown);
}

}  // namespace vantage::can
