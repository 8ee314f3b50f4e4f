#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "calib/drives_rig.h"
#include "drivers/can/canopen_master.h"
#include "drivers/can/cia402_axis.h"
#include "drivers/can/drive_setup.h"
#include "drivers/robot/cycle_statistics.h"
#include "drivers/robot/mecanum.h"
#include "drivers/robot/motion_limits.h"
#include "drivers/robot/robot_state.h"
#include "drivers/robot/twist_limiter.h"

namespace vantage {

/// Why everything was stopped. Made without allocation.
struct DrivesFault {
  enum class Source : std::uint8_t {
    kNone,
    kAxis,
    kBus,
    kStall  ///< this computer's loop stood still for longer than the drives wait
  };
  Source source = Source::kNone;
  std::size_t axis = 0;  ///< of kAxis
  can::AxisFailure failure;
  can::BusFaults bus;
  std::chrono::nanoseconds stalled{0};
  std::chrono::nanoseconds time{0};
};

/// Arm and mecanum base on CiA 402 drives: joints in cyclic synchronous position, wheels in cyclic synchronous
/// velocity.
///
/// One thread owns it. Each call of `cycle` is one beat: it waits for its time, takes what the drives said at the last
/// SYNC, checks every drive, limits the command, sends the set points and the next SYNC. It allocates nothing and takes
/// no lock. The first fault of any axis or of the bus stops all axes (quick stop); nothing moves again before `recover`
/// and `enable`. The master's heartbeat goes out from the same calls: should they stop, the drives stop by themselves.
///
/// The other calls are for setting up; they run cycles themselves, are bounded in time, and return a fault in one line
/// that names axis, state and object, or nothing.
class RobotDrives {
 public:
  /// All must outlive it. \throws InputError when an EDS can't be read, std::invalid_argument for too many axes.
  RobotDrives(can::CanBus& bus, const Clock& clock, const DrivesRig& rig);
  RobotDrives(const RobotDrives&) = delete;
  RobotDrives& operator=(const RobotDrives&) = delete;

  /// Tells every drive all it must know, reads it back, and starts the exchange at every SYNC. No power. → kReady
  std::string set_up();
  /// Finds the zero of every axis, all at once: switches on, moves, switches off again. kReady → kReady
  std::string home();
  /// Switches every axis on; each holds where it is. Every joint must have been homed. kReady → kEnabled
  std::string enable();
  /// Stops and switches off. kEnabled → kReady
  std::string disable();
  /// Out of a fault: restarts the controller after bus-off, sets every drive up again, resets the drives' faults.
  /// A drive that has started anew in the meantime must be homed again. kFault → kReady
  std::string recover();

  void cycle(const RobotCommand& command);
  /// Called at the end of every cycle, those of setting up included. It must not allocate or wait.
  void on_cycle(std::function<void(const RobotState&)> observer) { observer_ = std::move(observer); }

  const RobotState& state() const { return state_; }
  const DrivesFault& fault() const { return fault_; }
  /// The fault in words; empty when there is none.
  std::string fault_text() const;
  const CycleStatistics& punctuality() const { return punctuality_; }
  void clear_punctuality() { punctuality_.clear(); }
  const can::CanopenMaster& master() const { return master_; }
  std::string axis_name(std::size_t axis) const { return axes_[axis].setup.name; }
  int node(std::size_t axis) const { return axes_[axis].setup.node; }
  /// What 6064 says, in the joint's or wheel's radians: means an angle only after homing.
  double encoder_angle_rad(std::size_t axis) const { return axes_[axis].increments / axes_[axis].increments_per_rad; }

 private:
  struct Axis {
    can::DriveSetup setup;
    can::Cia402Axis machine;
    double increments_per_rad = 1;
    double zero_rad = 0;
    double lower_rad = 0, upper_rad = 0;  // joints: where it may be at all, the switch included
    double error_limit = 0;               // rad of a joint, rad/s of a wheel
    std::uint32_t boots = 0, emergencies = 0;
    std::uint64_t pdo_count = 0;
    int silent_cycles = 0;
    int error_cycles = 0;  // in a row with too large an error
    bool fresh = false, has_position = false;
    std::int32_t increments = 0;
    double wheel_rad = 0;       // turned since the start, beyond the 32 bits of 6064
    double command = 0;         // rad or rad/s, of the last cycle
    double command_before = 0;  // of the cycle before that
  };

  bool is_joint(std::size_t axis) const { return axis < joints_; }
  void take_feedback(std::size_t i);
  void take_odometry();
  void supervise(std::size_t i);
  void check_error(Axis& axis, std::size_t i);
  void command_axes(const RobotCommand& command);
  void send_set_point(std::size_t i);
  void fail_axis(std::size_t i);
  void fail_bus();
  void fail_stall(std::chrono::nanoseconds stalled);
  void stop_all();
  void cut_power_of_runaways();
  void aim_all(can::AxisAim aim);
  /// How late the cycle begins.
  std::chrono::nanoseconds wait_for_cycle();
  void resume_cycles();
  /// Runs cycles until `done`, a fault, or `limit` has passed.
  std::string run_until(const std::function<bool()>& done, std::chrono::nanoseconds limit, const char* what);
  std::string restart_bus();
  std::string set_up_all();

  can::CanBus& bus_;
  const Clock& clock_;
  DrivesRig rig_;
  can::CanopenMaster master_;
  std::vector<Axis> axes_;
  std::vector<MotionLimiter> joint_limiters_;
  std::size_t joints_;
  MecanumKinematics mecanum_;
  TwistLimiter twist_limiter_;
  WheelValues wheels_before_{};
  bool has_wheels_before_ = false;
  bool watches_motion_ = false;  // following errors and limits count
  std::chrono::nanoseconds next_cycle_{0};
  RobotState state_;
  DrivesFault fault_;
  CycleStatistics punctuality_;
  std::function<void(const RobotState&)> observer_;
};

}  // namespace vantage
