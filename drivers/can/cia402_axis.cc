#include "drivers/can/cia402_axis.h"

#include <cstdio>

namespace vantage::can {
namespace {

using std::chrono::nanoseconds;

constexpr int kUnknownInARow = 3;  // a single odd statusword may be caught between two states

const char* aim_words(AxisAim aim) {
  switch (aim) {
    case AxisAim::kOff:
      return "switch on disabled";
    case AxisAim::kOperation:
      return "operation enabled";
    case AxisAim::kQuickStop:
      return "a standstill by quick stop";
    case AxisAim::kFaultReset:
      return "a fault reset";
  }
  return "";
}

std::string seconds_text(nanoseconds time) {
  char text[32];
  std::snprintf(text, sizeof text, "%.2f s", std::chrono::duration<double>(time).count());
  return text;
}

std::string number_text(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.4g", value);
  return text;
}

std::string what_happened(const AxisFailure& failure) {
  const std::string state = std::string("\"") + to_text(failure.state) + "\"";
  switch (failure.fault) {
    case AxisFault::kNone:
      return "no failure";
    case AxisFault::kDriveFault:
      return "the drive reports a fault";
    case AxisFault::kTimedOut:
      return "stayed in " + state + " for " + seconds_text(failure.waited) + " on the way to " + aim_words(failure.aim);
    case AxisFault::kUnknownState:
      return "its statusword is none of CiA 402";
    case AxisFault::kLeftOperation:
      return "left operation by itself, is now in " + state;
    case AxisFault::kHomingFailed:
      return "homing failed after " + seconds_text(failure.waited);
    case AxisFault::kSetPointIgnored:
      return "took no new target (607A) for " + seconds_text(failure.waited);
    case AxisFault::kHeartbeatLost:
      return "silent: no heartbeat for " + seconds_text(failure.waited);
    case AxisFault::kRebooted:
      return "has started anew and lost its set-up";
    case AxisFault::kNoProcessData:
      return "sent no process data (TPDO 1) for " + seconds_text(failure.waited);
    case AxisFault::kFollowingError:
      return "following error " + number_text(failure.value) + " rad, at most " + number_text(failure.limit) + " rad";
    case AxisFault::kLimit:
      return "stands at " + number_text(failure.value) + " rad, beyond its limit " + number_text(failure.limit) +
             " rad";
  }
  return "";
}

}  // namespace

std::string to_text(const AxisFailure& failure, const std::string& axis, std::uint8_t node) {
  char words[80];
  std::snprintf(words, sizeof words, " (6041 statusword 0x%04X \"%s\", 6040 controlword 0x%04X", failure.statusword,
                to_text(failure.state), failure.controlword);
  std::string text = axis + " (node " + std::to_string(node) + "): " + what_happened(failure) + words;
  if (failure.error_code != 0) text += ", 603F " + error_code_text(failure.error_code);
  return text + ")";
}

void Cia402Axis::aim(AxisAim aim, nanoseconds now) {
  aim_ = aim;
  arrived_ = false;
  was_operating_ = false;
  reset_raised_ = false;
  since_ = now;
  homing_ = move_ = Phase::kIdle;
  unknown_ = 0;
  error_code_ = 0;
  failure_ = {};
}

void Cia402Axis::start_homing(nanoseconds now) {
  homing_ = Phase::kAsked;
  homing_since_ = now;
}

void Cia402Axis::start_move(nanoseconds now) {
  move_ = Phase::kAsked;
  move_since_ = now;
}

void Cia402Axis::fail(const AxisFailure& failure) {
  if (failure_) return;
  failure_ = failure;
  failure_.aim = aim_;
  failure_.state = state_;
  failure_.statusword = statusword_;
  failure_.controlword = controlword_;
  failure_.error_code = error_code_;
}

void Cia402Axis::fail(AxisFault fault, nanoseconds waited) {
  AxisFailure failure;
  failure.fault = fault;
  failure.waited = waited;
  fail(failure);
}

std::uint16_t Cia402Axis::step(std::uint16_t statusword, nanoseconds now) {
  statusword_ = statusword;
  const std::optional<DriveState> state = drive_state(statusword);
  if (!state) {
    if (++unknown_ >= kUnknownInARow) fail(AxisFault::kUnknownState, nanoseconds(0));
    return controlword_;
  }
  unknown_ = 0;
  if (*state != state_) since_ = now;
  state_ = *state;
  const bool faulted = state_ == DriveState::kFault || state_ == DriveState::kFaultReaction;
  if (faulted && aim_ != AxisAim::kFaultReset && aim_ != AxisAim::kOff) fail(AxisFault::kDriveFault, nanoseconds(0));
  if (aim_ == AxisAim::kOperation && was_operating_ && state_ != DriveState::kOperationEnabled) {
    fail(AxisFault::kLeftOperation, nanoseconds(0));
  }
  switch (aim_) {
    case AxisAim::kOff:
      controlword_ = towards_off();
      arrived_ = state_ == DriveState::kSwitchOnDisabled || faulted;
      break;
    case AxisAim::kOperation:
      // Who left operation by himself is not sent back without a new order.
      controlword_ = failure_ ? controlword::kQuickStop : towards_operation();
      arrived_ = state_ == DriveState::kOperationEnabled;
      was_operating_ = was_operating_ || arrived_;
      if (arrived_ && !failure_) controlword_ = operating(now);
      break;
    case AxisAim::kQuickStop:
      controlword_ = towards_quick_stop();
      break;
    case AxisAim::kFaultReset:
      controlword_ = towards_fault_reset();
      break;
  }
  if (!arrived_) check_time(now);
  return controlword_;
}

std::uint16_t Cia402Axis::towards_operation() {
  switch (state_) {
    case DriveState::kSwitchOnDisabled:
      return controlword::kShutdown;
    case DriveState::kReadyToSwitchOn:
      return controlword::kSwitchOn;
    case DriveState::kSwitchedOn:
    case DriveState::kOperationEnabled:
      return controlword::kEnableOperation;
    default:
      return controlword::kDisableVoltage;  // a quick stop has to be left through "switch on disabled"
  }
}

std::uint16_t Cia402Axis::towards_off() const { return controlword::kDisableVoltage; }

std::uint16_t Cia402Axis::towards_quick_stop() {
  // From operation the drive brakes by its own ramp; it then holds (605A 5 to 8) or is off (0 to 4). That it stands
  // still is measured by whoever knows its speed.
  arrived_ = state_ != DriveState::kOperationEnabled && state_ != DriveState::kFaultReaction;
  return controlword::kQuickStop;
}

std::uint16_t Cia402Axis::towards_fault_reset() {
  if (state_ != DriveState::kFault) {
    arrived_ = state_ != DriveState::kFaultReaction && state_ != DriveState::kNotReady;
    return controlword::kDisableVoltage;
  }
  // A rising edge each second cycle: a drive may have missed the first one.
  reset_raised_ = !reset_raised_;
  return reset_raised_ ? controlword::kFaultReset : controlword::kDisableVoltage;
}

std::uint16_t Cia402Axis::operating(nanoseconds now) {
  std::uint16_t word = controlword::kEnableOperation;
  if (homing_ == Phase::kAsked || homing_ == Phase::kRunning) {
    const bool attained = (statusword_ & statusword::kHomingAttained) != 0;
    const bool stopped = (statusword_ & statusword::kTargetReached) != 0;
    if ((statusword_ & statusword::kHomingError) != 0 || now - homing_since_ > timeouts_.homing) {
      fail(AxisFault::kHomingFailed, now - homing_since_);
      return controlword::kQuickStop;
    }
    // A drive that was homed before still says so until it has seen the order.
    if (homing_ == Phase::kRunning && attained && stopped) {
      homing_ = Phase::kDone;
      return word;
    }
    if (!attained || !stopped) homing_ = Phase::kRunning;
    word |= controlword::kStartHoming;
  }
  if (move_ == Phase::kAsked) {
    if ((statusword_ & statusword::kSetPointTaken) != 0) {
      move_ = Phase::kRunning;
    } else if (now - move_since_ > timeouts_.set_point) {
      fail(AxisFault::kSetPointIgnored, now - move_since_);
    } else {
      word |= controlword::kNewSetPoint | controlword::kChangeAtOnce;
    }
  } else if (move_ == Phase::kRunning && (statusword_ & statusword::kSetPointTaken) == 0 &&
             (statusword_ & statusword::kTargetReached) != 0) {
    move_ = Phase::kDone;
  }
  return word;
}

void Cia402Axis::check_time(nanoseconds now) {
  nanoseconds limit = timeouts_.transition;
  if (aim_ == AxisAim::kQuickStop) limit = timeouts_.quick_stop;
  if (aim_ == AxisAim::kFaultReset) limit = timeouts_.fault_reset;
  if (now - since_ > limit) fail(AxisFault::kTimedOut, now - since_);
}

}  // namespace vantage::can
