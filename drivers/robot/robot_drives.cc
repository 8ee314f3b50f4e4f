#include "drivers/robot/robot_drives.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <stdexcept>
#include <utility>

#include "drivers/robot/drive_setups.h"

namespace vantage {
namespace {

using can::AxisAim;
using can::AxisFailure;
using can::AxisFault;
using can::DriveMode;
using std::chrono::milliseconds;
using std::chrono::nanoseconds;
using std::chrono::seconds;

constexpr int kSilentCycles = 3;       // without process data: the drive is lost
constexpr int kJointErrorCycles = 3;   // a following error that lasts
constexpr int kWheelErrorCycles = 20;  // a wheel's speed may lag while it accelerates
constexpr int kHeartbeatsMissed = 4;
constexpr milliseconds kStandstillPatience{1000};  // after a quick stop; whoever still moves then loses its power
constexpr double kStandstill = 0.05;               // rad/s
constexpr seconds kTransitionPatience{5};          // over the axes' own time-outs, which tell more

double seconds_of(nanoseconds time) { return std::chrono::duration<double>(time).count(); }

can::MasterOptions master_options(const DrivesRig& rig) {
  can::MasterOptions options;
  options.heartbeat_period = rig.heartbeat;
  return options;
}

MecanumKinematics kinematics_of(const DrivesRig& rig) {
  return rig.base ? MecanumKinematics(rig.base->wheel_radius_m, rig.base->length_m, rig.base->width_m)
                  : MecanumKinematics(1, 1, 1);
}

TwistLimiter twist_limiter_of(const DrivesRig& rig) {
  TwistLimits limits;
  if (rig.base) {
    limits = {rig.base->speed_m_s, rig.base->turn_speed_rad_s, rig.base->acceleration_m_s2,
              rig.base->turn_acceleration_rad_s2};
  }
  return {limits, kinematics_of(rig), rig.base ? rig.base->wheel_radius_m : 1, seconds_of(rig.cycle)};
}

}  // namespace

RobotDrives::RobotDrives(can::CanBus& bus, const Clock& clock, const DrivesRig& rig)
    : bus_(bus),
      clock_(clock),
      rig_(rig),
      master_(bus, clock, master_options(rig)),
      joints_(rig.joints.size()),
      mecanum_(kinematics_of(rig)),
      twist_limiter_(twist_limiter_of(rig)),
      next_cycle_(clock.monotonic() + rig.cycle) {
  if (rig.axes() > kMostAxes) throw std::invalid_argument("RobotDrives: more than 16 axes");
  for (const JointRig& joint : rig.joints) {
    Axis axis;
    axis.setup = joint_setup(rig, joint);
    axis.increments_per_rad = joint.drive.increments_per_rad();
    axis.zero_rad = joint.zero_rad;
    axis.lower_rad = std::min(joint.lower_rad, joint.zero_rad) - kRangeMargin_rad;
    axis.upper_rad = std::max(joint.upper_rad, joint.zero_rad) + kRangeMargin_rad;
    axis.error_limit = joint.following_error_rad;
    axes_.push_back(axis);
    joint_limiters_.emplace_back(
        MotionLimits{joint.lower_rad, joint.upper_rad, joint.speed_rad_s, joint.acceleration_rad_s2},
        seconds_of(rig.cycle));
  }
  if (rig.base) {
    for (const DriveRig& wheel : rig.base->wheels) {
      Axis axis;
      axis.setup = wheel_setup(rig, *rig.base, wheel);
      axis.increments_per_rad = wheel.increments_per_rad();
      axis.error_limit = rig.base->speed_error_rad_s;
      axes_.push_back(axis);
    }
  }
  for (const Axis& axis : axes_) master_.listen_to(axis.setup.node);
  state_.joints = joints_;
  state_.axes = axes_.size();
}

// --- Setting up

std::string RobotDrives::set_up_all() {
  master_.clear_bus_faults();
  for (Axis& axis : axes_) {
    std::string fault = can::set_up_drive(master_, axis.setup);
    if (!fault.empty()) return fault;
    axis.boots = master_.node(axis.setup.node).boots;
    axis.emergencies = master_.node(axis.setup.node).emergencies;
    axis.pdo_count = master_.received(can::kCyclicPdo, axis.setup.node).count;
    axis.silent_cycles = axis.error_cycles = 0;
    axis.has_position = false;
  }
  has_wheels_before_ = watches_motion_ = false;
  fault_ = {};
  state_.phase = DrivesPhase::kReady;
  aim_all(AxisAim::kOff);
  resume_cycles();
  // Until every drive has answered the SYNC.
  const auto answered = [this] {
    return std::all_of(axes_.begin(), axes_.end(), [](const Axis& axis) { return axis.has_position; });
  };
  return run_until(answered, seconds(1), "the drives' first process data");
}

std::string RobotDrives::set_up() { return set_up_all(); }

std::string RobotDrives::run_until(const std::function<bool()>& done, nanoseconds limit, const char* what) {
  const nanoseconds deadline = clock_.monotonic() + limit;
  while (!done()) {
    if (state_.phase == DrivesPhase::kFault) return fault_text();
    if (clock_.monotonic() >= deadline) return std::string(what) + " took too long";
    cycle({});
  }
  return state_.phase == DrivesPhase::kFault ? fault_text() : "";
}

std::string RobotDrives::home() {
  if (state_.phase != DrivesPhase::kReady) return "homing needs drives that are set up and without power";
  const auto all = [this](auto&& is) { return std::all_of(axes_.begin(), axes_.end(), is); };
  const auto switch_modes = [this](bool to_homing) -> std::string {
    for (Axis& axis : axes_) {
      std::string fault = can::change_mode(master_, axis.setup, to_homing ? DriveMode::kHoming : axis.setup.mode);
      if (!fault.empty()) return fault;
    }
    resume_cycles();
    return {};
  };
  const auto arrived = [](const Axis& axis) { return axis.machine.arrived(); };
  for (std::size_t i = 0; i < axes_.size(); ++i) state_.axis[i].homed = false;
  if (std::string fault = switch_modes(true); !fault.empty()) return fault;
  aim_all(AxisAim::kOperation);
  std::string fault = run_until([&] { return all(arrived); }, kTransitionPatience, "switching on to home");
  if (!fault.empty()) return fault;
  for (Axis& axis : axes_) axis.machine.start_homing(clock_.monotonic());
  const nanoseconds patience = can::AxisTimeouts{}.homing + kTransitionPatience;
  fault = run_until([&] { return all([](const Axis& axis) { return axis.machine.homed(); }); }, patience, "homing");
  if (!fault.empty()) return fault;
  aim_all(AxisAim::kOff);
  fault = run_until([&] { return all(arrived); }, kTransitionPatience, "switching off after homing");
  if (!fault.empty()) return fault;
  if (fault = switch_modes(false); !fault.empty()) return fault;
  for (std::size_t i = 0; i < axes_.size(); ++i) state_.axis[i].homed = true;
  // 6064 now counts from the zero that was found.
  for (Axis& axis : axes_) axis.has_position = false;
  has_wheels_before_ = false;
  return run_until([&] { return all([](const Axis& axis) { return axis.has_position; }); }, seconds(1),
                   "process data after homing");
}

std::string RobotDrives::enable() {
  if (state_.phase != DrivesPhase::kReady) return "switching on needs drives that are set up and without power";
  for (std::size_t i = 0; i < joints_; ++i) {
    if (!state_.axis[i].homed) return axis_name(i) + " has not been homed";
  }
  aim_all(AxisAim::kOperation);
  watches_motion_ = true;
  const auto arrived = [this] {
    return std::all_of(axes_.begin(), axes_.end(), [](const Axis& axis) { return axis.machine.arrived(); });
  };
  std::string fault = run_until(arrived, kTransitionPatience, "switching on");
  if (fault.empty()) state_.phase = DrivesPhase::kEnabled;
  return fault;
}

std::string RobotDrives::disable() {
  if (state_.phase != DrivesPhase::kEnabled) return {};
  const auto at_rest = [this] {
    bool rest = true;
    for (std::size_t i = 0; i < joints_; ++i) rest = rest && joint_limiters_[i].speed() == 0;
    for (std::size_t i = joints_; i < axes_.size(); ++i) rest = rest && axes_[i].command == 0;
    return rest;
  };
  std::string fault = run_until(at_rest, kTransitionPatience, "coming to rest");
  if (!fault.empty()) return fault;
  watches_motion_ = false;
  state_.phase = DrivesPhase::kReady;
  aim_all(AxisAim::kOff);
  return run_until(
      [this] {
        return std::all_of(axes_.begin(), axes_.end(), [](const Axis& axis) { return axis.machine.arrived(); });
      },
      kTransitionPatience, "switching off");
}

std::string RobotDrives::restart_bus() {
  if (fault_.source == DrivesFault::Source::kBus && fault_.bus.bus_off != 0 && master_.bus_faults().restarted == 0) {
    std::string why;
    if (!bus_.restart(&why)) return why;
    const nanoseconds deadline = clock_.monotonic() + seconds(1);
    while (master_.bus_faults().restarted == 0) {
      if (clock_.monotonic() >= deadline) return bus_.name() + ": the controller does not come back from bus-off";
      master_.poll_until(clock_.monotonic() + milliseconds(10));
    }
  }
  return {};
}

std::string RobotDrives::recover() {
  if (state_.phase != DrivesPhase::kFault) return "there is no fault to recover from";
  if (std::string why = restart_bus(); !why.empty()) return why;
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    if (master_.node(axes_[i].setup.node).boots != axes_[i].boots) state_.axis[i].homed = false;
  }
  if (std::string why = set_up_all(); !why.empty()) {
    state_.phase = DrivesPhase::kFault;
    return why;
  }
  aim_all(AxisAim::kFaultReset);
  const auto arrived = [this] {
    return std::all_of(axes_.begin(), axes_.end(), [](const Axis& axis) { return axis.machine.arrived(); });
  };
  std::string why = run_until(arrived, kTransitionPatience, "resetting the drives' faults");
  if (!why.empty()) return why;
  aim_all(AxisAim::kOff);
  return run_until(arrived, kTransitionPatience, "switching off");
}

std::string RobotDrives::fault_text() const {
  if (fault_.source == DrivesFault::Source::kNone) return "";
  if (fault_.source == DrivesFault::Source::kBus) return bus_.name() + ": " + to_text(fault_.bus);
  if (fault_.source == DrivesFault::Source::kStall) {
    char text[128];
    std::snprintf(text, sizeof text,
                  "this computer's loop stood still for %.2f s; the drives have stopped by themselves",
                  seconds_of(fault_.stalled));
    return text;
  }
  AxisFailure failure = fault_.failure;
  const Axis& axis = axes_[fault_.axis];
  // The emergency that tells why may come just after the statusword.
  if (failure.error_code == 0 && master_.node(axis.setup.node).emergencies != axis.emergencies) {
    failure.error_code = master_.node(axis.setup.node).emergency.error_code;
  }
  return to_text(failure, axis.setup.name, axis.setup.node);
}

void RobotDrives::aim_all(AxisAim aim) {
  for (Axis& axis : axes_) axis.machine.aim(aim, clock_.monotonic());
}

// --- The cycle

void RobotDrives::resume_cycles() { next_cycle_ = clock_.monotonic() + rig_.cycle; }

nanoseconds RobotDrives::wait_for_cycle() {
  master_.sleep_until(next_cycle_);
  const nanoseconds now = clock_.monotonic(), late = now - next_cycle_;
  punctuality_.add(late);
  next_cycle_ += rig_.cycle;
  if (now < next_cycle_) return late;
  // Late by more than a cycle: what was missed is left out, never made up for.
  const auto missed = (now - next_cycle_) / rig_.cycle + 1;
  punctuality_.add_missed(static_cast<std::uint64_t>(missed));
  next_cycle_ += missed * nanoseconds(rig_.cycle);
  return late;
}

void RobotDrives::cycle(const RobotCommand& command) {
  const nanoseconds late = wait_for_cycle();
  state_.time = clock_.monotonic();
  ++state_.cycle;
  if (state_.phase == DrivesPhase::kOff) return;
  if (late > rig_.stop_after && state_.phase == DrivesPhase::kEnabled) fail_stall(late);
  for (std::size_t i = 0; i < axes_.size(); ++i) take_feedback(i);
  take_odometry();
  for (std::size_t i = 0; i < axes_.size(); ++i) supervise(i);
  if (state_.phase == DrivesPhase::kFault) cut_power_of_runaways();
  if (master_.bus_faults().any() && state_.phase != DrivesPhase::kFault) fail_bus();
  command_axes(command);
  for (std::size_t i = 0; i < axes_.size(); ++i) send_set_point(i);
  master_.send_sync();
  if (observer_) observer_(state_);
}

void RobotDrives::take_feedback(std::size_t i) {
  Axis& axis = axes_[i];
  AxisState& shown = state_.axis[i];
  const can::ReceivedPdo& pdo = master_.received(can::kCyclicPdo, axis.setup.node);
  axis.fresh = pdo.count != axis.pdo_count && pdo.size == can::kCyclicPdoBytes;
  axis.pdo_count = pdo.count;
  if (!axis.fresh) {
    ++axis.silent_cycles;
    return;
  }
  const double period_s = seconds_of(rig_.cycle) * (1 + axis.silent_cycles);
  axis.silent_cycles = 0;
  const auto position = static_cast<std::int32_t>(can::get_number(std::span(pdo.data).subspan(2, 4), true));
  // 6064 of a wheel runs over after some kilometres: the difference does not.
  const auto moved =
      static_cast<std::int32_t>(static_cast<std::uint32_t>(position) - static_cast<std::uint32_t>(axis.increments));
  axis.increments = position;
  const double moved_rad = axis.has_position ? moved / axis.increments_per_rad : 0;
  axis.has_position = true;
  axis.wheel_rad += moved_rad;
  shown.speed_rad_s = moved_rad / period_s;
  shown.position_rad = is_joint(i) ? axis.zero_rad + position / axis.increments_per_rad : axis.wheel_rad;
  shown.time = pdo.time;
}

void RobotDrives::take_odometry() {
  if (!rig_.base) return;
  WheelValues wheels{}, moved{}, speeds{};
  for (std::size_t w = 0; w < wheels.size(); ++w) {
    wheels[w] = axes_[joints_ + w].wheel_rad;
    moved[w] = wheels[w] - wheels_before_[w];
    speeds[w] = state_.axis[joints_ + w].speed_rad_s;
  }
  wheels_before_ = wheels;
  if (!std::exchange(has_wheels_before_, true)) return;
  state_.base = advance(state_.base, mecanum_.twist_of(moved));
  state_.base_speed = mecanum_.twist_of(speeds);
}

void RobotDrives::supervise(std::size_t i) {
  Axis& axis = axes_[i];
  const can::NodeStatus& node = master_.node(axis.setup.node);
  if (node.emergencies != axis.emergencies && node.emergency.error_code != 0) {
    axis.machine.set_error_code(node.emergency.error_code);
  }
  AxisFailure failure;
  failure.waited = state_.time - node.last_heartbeat;
  if (node.boots != axis.boots) {
    failure.fault = AxisFault::kRebooted;
  } else if (failure.waited > kHeartbeatsMissed * nanoseconds(axis.setup.heartbeat_period)) {
    failure.fault = AxisFault::kHeartbeatLost;
  } else if (axis.silent_cycles > kSilentCycles) {
    failure.fault = AxisFault::kNoProcessData;
    failure.waited = axis.silent_cycles * nanoseconds(rig_.cycle);
  }
  if (failure) axis.machine.fail(failure);
  if (watches_motion_ && axis.fresh) check_error(axis, i);
  if (axis.machine.failure() && state_.phase != DrivesPhase::kFault) fail_axis(i);
}

/// What the drive measured at the last SYNC answers the set point of the SYNC before: it has a cycle to get there.
void RobotDrives::check_error(Axis& axis, std::size_t i) {
  AxisState& shown = state_.axis[i];
  const double is = is_joint(i) ? shown.position_rad : shown.speed_rad_s;
  const double error = axis.command_before - is;
  if (is_joint(i)) shown.following_error_rad = error;
  if (axis.machine.state() != can::DriveState::kOperationEnabled) return;
  axis.error_cycles = std::abs(error) > axis.error_limit ? axis.error_cycles + 1 : 0;
  AxisFailure failure;
  if (axis.error_cycles > (is_joint(i) ? kJointErrorCycles : kWheelErrorCycles)) {
    failure.fault = AxisFault::kFollowingError;
    failure.value = error;
    failure.limit = axis.error_limit;
  } else if (is_joint(i) && (is < axis.lower_rad || is > axis.upper_rad)) {
    failure.fault = AxisFault::kLimit;
    failure.value = is;
    failure.limit = is < axis.lower_rad ? axis.lower_rad : axis.upper_rad;
  }
  if (failure) axis.machine.fail(failure);
}

void RobotDrives::fail_axis(std::size_t i) {
  fault_ = {DrivesFault::Source::kAxis, i, axes_[i].machine.failure(), {}, nanoseconds(0), state_.time};
  stop_all();
}

void RobotDrives::fail_bus() {
  fault_ = {DrivesFault::Source::kBus, 0, {}, master_.bus_faults(), nanoseconds(0), state_.time};
  stop_all();
}

void RobotDrives::fail_stall(nanoseconds stalled) {
  fault_ = {DrivesFault::Source::kStall, 0, {}, {}, stalled, state_.time};
  stop_all();
}

void RobotDrives::stop_all() {
  state_.phase = DrivesPhase::kFault;
  watches_motion_ = false;
  aim_all(AxisAim::kQuickStop);
}

/// A drive that does not obey the quick stop is switched off, which sets its brake.
void RobotDrives::cut_power_of_runaways() {
  if (state_.time - fault_.time < kStandstillPatience) return;
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    const bool moves = axes_[i].fresh && std::abs(state_.axis[i].speed_rad_s) > kStandstill;
    if (moves && axes_[i].machine.aimed() == AxisAim::kQuickStop) axes_[i].machine.aim(AxisAim::kOff, state_.time);
  }
}

void RobotDrives::command_axes(const RobotCommand& command) {
  const bool moves = state_.phase == DrivesPhase::kEnabled && state_.time <= command.valid_until;
  for (std::size_t i = 0; i < joints_; ++i) {
    Axis& axis = axes_[i];
    MotionLimiter& limiter = joint_limiters_[i];
    axis.command_before = axis.command;
    if (axis.machine.state() != can::DriveState::kOperationEnabled || !watches_motion_) {
      // A drive without power is where it is; its set point goes with it, so that switching on moves nothing.
      limiter.reset(state_.axis[i].position_rad);
      axis.command = state_.axis[i].position_rad;
      axis.command_before = axis.command;
      continue;
    }
    if (moves && command.arm == RobotCommand::Arm::kPosition) {
      axis.command = limiter.towards(command.joints[i]);
    } else {
      axis.command = limiter.at_speed(moves && command.arm == RobotCommand::Arm::kSpeed ? command.joints[i] : 0);
    }
    state_.axis[i].limited = limiter.limited();
  }
  if (!rig_.base) return;
  if (state_.phase != DrivesPhase::kEnabled) twist_limiter_.reset();
  const WheelValues wheels = mecanum_.wheels_of(twist_limiter_.towards(moves ? command.base : BaseTwist{}));
  for (std::size_t w = 0; w < wheels.size(); ++w) {
    Axis& axis = axes_[joints_ + w];
    axis.command_before = axis.command;
    axis.command = wheels[w];
    state_.axis[joints_ + w].limited = twist_limiter_.limited();
  }
}

void RobotDrives::send_set_point(std::size_t i) {
  Axis& axis = axes_[i];
  std::uint16_t word = can::controlword::kDisableVoltage;
  if (axis.has_position) {
    const auto status = static_cast<std::uint16_t>(
        can::get_number(std::span(master_.received(can::kCyclicPdo, axis.setup.node).data).first(2), false));
    word = axis.machine.step(status, state_.time);
    state_.axis[i].drive = axis.machine.state();
  }
  const double target =
      is_joint(i) ? (axis.command - axis.zero_rad) * axis.increments_per_rad : axis.command * axis.increments_per_rad;
  std::array<std::uint8_t, can::kCyclicPdoBytes> data{};
  can::put_number(word, 2, data.data());
  can::put_number(std::llround(target), 4, data.data() + 2);
  master_.send_pdo(can::pdo_id(can::PdoDirection::kToDrive, can::kCyclicPdo, axis.setup.node), data);
}

}  // namespace vantage
