#include "drivers/sim/drive_axis.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace vantage::sim {
namespace {

using can::DriveMode;
using can::DriveState;
namespace objects = can::objects;
namespace controlword = can::controlword;
namespace statusword = can::statusword;

constexpr double kStandstill = 50;  // increments/s
constexpr double kReached = 10;     // increments
constexpr std::uint16_t kTripFollowing = 0x8611;

}  // namespace

DriveAxis::DriveAxis(DriveDictionary& dictionary, const MotorOptions& motor, const LimitSwitches& switches)
    : dictionary_(dictionary), motor_(motor), switches_(switches) {
  origin_ = demand_ = motor_.position();
}

void DriveAxis::switch_on() {
  state_ = DriveState::kNotReady;
  origin_ = motor_.position();
  homed_ = has_target_ = profile_moving_ = set_point_taken_ = limited_ = false;
  homing_ = HomingPhase::kIdle;
  last_controlword_ = 0;
  emergency_.reset();
}

void DriveAxis::get_ready() {
  if (state_ == DriveState::kNotReady) enter(DriveState::kSwitchOnDisabled);
}

void DriveAxis::quick_stop() {
  if (state_ == DriveState::kOperationEnabled) enter(DriveState::kQuickStopActive);
}

void DriveAxis::disable_voltage() {
  if (state_ != DriveState::kFault && state_ != DriveState::kFaultReaction) enter(DriveState::kSwitchOnDisabled);
}

void DriveAxis::on_sync() {
  if (mode() != DriveMode::kCyclicPosition || state_ != DriveState::kOperationEnabled) return;
  sync_target_ = demand_from(number(objects::kTargetPosition));
  sync_left_s_ = number(objects::kCyclePeriod) * std::pow(10, number(objects::kCycleExponent));
  has_target_ = true;
  limited_ = sync_target_ != number(objects::kTargetPosition) + origin_;
}

void DriveAxis::measure() {
  dictionary_.set(objects::kStatusword, statusword());
  dictionary_.set(objects::kActualPosition, actual_position());
  dictionary_.set(objects::kActualVelocity, std::lround(motor_.speed()));
  dictionary_.set(objects::kFollowingError, std::lround(demand_ - motor_.position()));
}

std::optional<std::uint16_t> DriveAxis::take_emergency() { return std::exchange(emergency_, std::nullopt); }

DriveMode DriveAxis::mode() const { return static_cast<DriveMode>(dictionary_.get(objects::kModeDisplay)); }

std::int32_t DriveAxis::actual_position() const {
  return static_cast<std::int32_t>(std::lround(motor_.position() - origin_));
}

/// A target in the drive's own coordinates, cut to 607D, on the machine's scale.
double DriveAxis::demand_from(double target) const {
  const double low = number(objects::kLowestPosition), high = number(objects::kHighestPosition);
  const double cut = homed_ && low < high ? std::clamp(target, low, high) : target;
  return cut + origin_;
}

std::uint16_t DriveAxis::statusword() const {
  constexpr std::uint16_t kRemote = 0x200;
  std::uint16_t word = kRemote | statusword::kVoltage;
  switch (state_) {
    case DriveState::kNotReady:
      break;
    case DriveState::kSwitchOnDisabled:
      word |= 0x40;
      break;
    case DriveState::kReadyToSwitchOn:
      word |= 0x21;
      break;
    case DriveState::kSwitchedOn:
      word |= 0x23;
      break;
    case DriveState::kOperationEnabled:
      word |= 0x27;
      break;
    case DriveState::kQuickStopActive:
      word |= 0x07;
      break;
    case DriveState::kFaultReaction:
      word |= 0x0F;
      break;
    case DriveState::kFault:
      word |= 0x08;
      break;
  }
  if (limited_) word |= statusword::kInternalLimit;
  const bool stands = std::abs(motor_.speed()) < kStandstill;
  if (state_ == DriveState::kQuickStopActive && stands) word |= statusword::kTargetReached;
  if (state_ != DriveState::kOperationEnabled) return word;
  switch (mode()) {
    case DriveMode::kHoming:
      if (homed_ && homing_ != HomingPhase::kToSwitch && homing_ != HomingPhase::kOffSwitch) {
        word |= statusword::kHomingAttained;
      }
      if (stands && homing_ != HomingPhase::kToSwitch && homing_ != HomingPhase::kOffSwitch) {
        word |= statusword::kTargetReached;
      }
      if (homing_ == HomingPhase::kFailed) word |= statusword::kHomingError;
      break;
    case DriveMode::kProfilePosition:
      if (set_point_taken_) word |= statusword::kSetPointTaken;
      if (!profile_moving_ && stands) word |= statusword::kTargetReached;
      if (following_warning_) word |= statusword::kFollowingError;
      break;
    case DriveMode::kCyclicPosition:
      word |= statusword::kFollowsTarget;
      if (following_warning_) word |= statusword::kFollowingError;
      break;
    case DriveMode::kCyclicVelocity:
      word |= statusword::kFollowsTarget;
      break;
    default:
      break;
  }
  return word;
}

void DriveAxis::enter(DriveState state) {
  if (state == state_) return;
  state_ = state;
  demand_ = motor_.position();
  demand_speed_ = state == DriveState::kOperationEnabled ? 0 : motor_.speed();
  has_target_ = profile_moving_ = false;
  following_time_s_ = 0;
  if (homing_ == HomingPhase::kToSwitch || homing_ == HomingPhase::kOffSwitch) homing_ = HomingPhase::kFailed;
  if (state == DriveState::kOperationEnabled) homing_ = HomingPhase::kIdle;
}

void DriveAxis::obey_controlword() {
  const auto word = static_cast<std::uint16_t>(dictionary_.get(objects::kControlword));
  const std::uint16_t risen = static_cast<std::uint16_t>(word & ~last_controlword_);
  const std::uint16_t fallen = static_cast<std::uint16_t>(last_controlword_ & ~word);
  last_controlword_ = word;
  if (state_ == DriveState::kFault) {
    if ((risen & controlword::kFaultReset) != 0) {
      dictionary_.set(objects::kErrorCode, 0);
      dictionary_.set(objects::kErrorRegister, 0);
      emergency_ = 0;
      enter(DriveState::kSwitchOnDisabled);
    }
    return;
  }
  if (state_ == DriveState::kNotReady || state_ == DriveState::kFaultReaction) return;
  const bool voltage = (word & 2) != 0, no_quick_stop = (word & 4) != 0;
  if (!voltage) return enter(DriveState::kSwitchOnDisabled);
  if (!no_quick_stop) {
    if (state_ == DriveState::kOperationEnabled) return enter(DriveState::kQuickStopActive);
    if (state_ != DriveState::kQuickStopActive) enter(DriveState::kSwitchOnDisabled);
    return;
  }
  if (state_ == DriveState::kQuickStopActive) return;  // only "disable voltage" leads out
  const bool switch_on = (word & 1) != 0, enable = (word & 8) != 0;
  if (!switch_on) return enter(DriveState::kReadyToSwitchOn);
  if (state_ == DriveState::kSwitchOnDisabled) return;
  if (state_ == DriveState::kReadyToSwitchOn) return enter(DriveState::kSwitchedOn);
  enter(enable ? DriveState::kOperationEnabled : DriveState::kSwitchedOn);
  if (state_ != DriveState::kOperationEnabled) return;
  if (mode() == DriveMode::kHoming && (risen & controlword::kStartHoming) != 0) {
    homed_ = false;
    homing_ = HomingPhase::kToSwitch;
    demand_ = motor_.position();
  }
  if (mode() == DriveMode::kProfilePosition) {
    if ((risen & controlword::kNewSetPoint) != 0) {
      profile_target_ = demand_from(number(objects::kTargetPosition));
      profile_moving_ = set_point_taken_ = true;
    }
    if ((fallen & controlword::kNewSetPoint) != 0) set_point_taken_ = false;
  }
}

void DriveAxis::trip(std::uint16_t code) {
  if (state_ == DriveState::kFault || state_ == DriveState::kFaultReaction) return;
  dictionary_.set(objects::kErrorCode, code);
  dictionary_.set(objects::kErrorRegister, code >> 8 == 0x81 ? 0x11 : 0x21);
  dictionary_.set({0x1003, 0}, 1);
  dictionary_.set(objects::kErrorHistory, code);
  emergency_ = code;
  const bool moving = state_ == DriveState::kOperationEnabled || state_ == DriveState::kQuickStopActive;
  enter(moving ? DriveState::kFaultReaction : DriveState::kFault);
}

void DriveAxis::step(double dt) {
  switch (state_) {
    case DriveState::kOperationEnabled:
      operate(dt);
      watch_following_error(dt);
      break;
    case DriveState::kQuickStopActive:
      if (brake(dt) && dictionary_.get(objects::kQuickStopReaction) < 5) enter(DriveState::kSwitchOnDisabled);
      break;
    case DriveState::kFaultReaction:
      if (brake(dt)) enter(DriveState::kFault);
      break;
    default:
      motor_.coast(dt);
      demand_ = motor_.position();
  }
}

/// Down the quick-stop ramp; true at standstill, where the position is held.
bool DriveAxis::brake(double dt) {
  const double change = number(objects::kQuickStopDeceleration) * dt;
  demand_speed_ -= std::clamp(demand_speed_, -change, change);
  demand_ += demand_speed_ * dt;
  motor_.follow(demand_, demand_speed_, dt);
  return demand_speed_ == 0 && std::abs(motor_.speed()) < kStandstill;
}

void DriveAxis::operate(double dt) {
  switch (mode()) {
    case DriveMode::kCyclicPosition:
      if (has_target_ && sync_left_s_ > 0) {
        // Straight to the target at the cycle's end.
        demand_speed_ = (sync_target_ - demand_) / std::max(sync_left_s_, dt);
        demand_ += demand_speed_ * dt;
        sync_left_s_ -= dt;
      } else {
        demand_speed_ = 0;  // no new target: stand at the last one
      }
      motor_.follow(demand_, demand_speed_, dt);
      break;
    case DriveMode::kCyclicVelocity:
    case DriveMode::kProfileVelocity: {
      const double most = number(objects::kHighestSpeed);
      const double wanted = std::clamp(number(objects::kTargetVelocity), -most, most);
      limited_ = wanted != number(objects::kTargetVelocity);
      const double change = number(objects::kProfileAcceleration) * dt;
      demand_speed_ += mode() == DriveMode::kCyclicVelocity ? wanted - demand_speed_
                                                            : std::clamp(wanted - demand_speed_, -change, change);
      motor_.run(demand_speed_, dt);
      demand_ = motor_.position();
      break;
    }
    case DriveMode::kProfilePosition:
      operate_profile(dt);
      break;
    case DriveMode::kHoming:
      operate_homing(dt);
      break;
    default:
      motor_.follow(demand_, 0, dt);
  }
}

/// A trapezoid of 6081, 6083 and 6084 towards the target.
void DriveAxis::operate_profile(double dt) {
  if (profile_moving_) {
    const double distance = profile_target_ - demand_;
    const double direction = distance < 0 ? -1 : 1;
    const double braking = std::sqrt(2 * number(objects::kProfileDeceleration) * std::abs(distance));
    const double wanted = direction * std::min(number(objects::kProfileSpeed), braking);
    const double change = number(objects::kProfileAcceleration) * dt;
    demand_speed_ += std::clamp(wanted - demand_speed_, -change, change);
    demand_ += demand_speed_ * dt;
    if (std::abs(profile_target_ - demand_) < kReached && std::abs(demand_speed_) <= 2 * change) {
      demand_ = profile_target_;
      demand_speed_ = 0;
      profile_moving_ = false;
    }
  }
  motor_.follow(demand_, demand_speed_, dt);
}

/// Methods 17 and 18: to the limit switch at 6099:1, off it at 6099:2; zero is where it opens. 35 and 37: here.
void DriveAxis::operate_homing(double dt) {
  const std::int64_t method = dictionary_.get(objects::kHomingMethod);
  const double towards = method == 17 ? -1 : 1;
  const bool closed = method == 17 ? motor_.position() <= switches_.negative : motor_.position() >= switches_.positive;
  double wanted = 0;
  switch (homing_) {
    case HomingPhase::kIdle:
    case HomingPhase::kDone:
    case HomingPhase::kFailed:
      break;
    case HomingPhase::kToSwitch:
      if (method == 35 || method == 37) {
        finish_homing();
      } else if (method != 17 && method != 18) {
        homing_ = HomingPhase::kFailed;
      } else if (closed) {
        homing_ = HomingPhase::kOffSwitch;
      } else {
        wanted = towards * number(objects::kHomingSwitchSpeed);
      }
      break;
    case HomingPhase::kOffSwitch:
      wanted = -towards * number(objects::kHomingZeroSpeed);
      if (!closed) {
        wanted = 0;
        finish_homing();
      }
      break;
  }
  const double change = number(objects::kHomingAcceleration) * dt;
  demand_speed_ += std::clamp(wanted - demand_speed_, -change, change);
  demand_ += demand_speed_ * dt;
  motor_.follow(demand_, demand_speed_, dt);
}

void DriveAxis::finish_homing() {
  const std::int64_t method = dictionary_.get(objects::kHomingMethod);
  // The switch's edge itself, which a drive latches between two steps of its servo.
  double edge = motor_.position();
  if (method == 17) edge = switches_.negative;
  if (method == 18) edge = switches_.positive;
  origin_ = edge - number(objects::kHomeOffset);
  homed_ = true;
  homing_ = HomingPhase::kDone;
}

void DriveAxis::watch_following_error(double dt) {
  if (mode() == DriveMode::kCyclicVelocity || mode() == DriveMode::kProfileVelocity) return;
  following_warning_ = std::abs(demand_ - motor_.position()) > number(objects::kFollowingErrorWindow);
  following_time_s_ = following_warning_ ? following_time_s_ + dt : 0;
  if (following_time_s_ * 1000 > number(objects::kFollowingErrorTime)) trip(kTripFollowing);
}

}  // namespace vantage::sim
