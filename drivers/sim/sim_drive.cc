#include "drivers/sim/sim_drive.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "drivers/can/emergency.h"
#include "drivers/can/sdo_transfer.h"

namespace vantage::sim {
namespace {

using can::CanFrame;
using can::DriveMode;
using can::DriveState;
using can::NmtState;
using can::ObjectAddress;
using can::PdoDirection;
using can::SdoAbort;
using std::chrono::nanoseconds;
namespace objects = can::objects;
namespace controlword = can::controlword;
namespace statusword = can::statusword;

constexpr nanoseconds kBootTime = std::chrono::milliseconds(50);  // from switching on to "switch on disabled"
constexpr double kLongestStep = 1e-3;                             // s, of the motor's integration
constexpr double kStandstill = 50;                                // increments/s
constexpr double kReached = 10;                                   // increments
constexpr std::uint8_t kLastSyncType = 240;

constexpr std::uint16_t kTripByMaster = 0x8130, kTripFollowing = 0x8611;
constexpr std::uint16_t kTripCommunication = 0x8100;

double seconds_of(nanoseconds time) { return std::chrono::duration<double>(time).count(); }

bool is_mapping(ObjectAddress a) { return (a.index & 0xFFFC) == 0x1600 || (a.index & 0xFFFC) == 0x1A00; }
bool is_pdo_parameter(ObjectAddress a) { return (a.index & 0xFFFC) == 0x1400 || (a.index & 0xFFFC) == 0x1800; }

/// The identifier entry of the PDO that a mapping belongs to.
ObjectAddress identifier_of(ObjectAddress mapping) { return {static_cast<std::uint16_t>(mapping.index - 0x200), 1}; }

}  // namespace

SimDrive::SimDrive(const SimDriveOptions& options, nanoseconds now)
    : options_(options), motor_(options.motor), now_(now), started_(now) {
  define_objects();
  origin_ = demand_ = motor_.position();
}

void SimDrive::define_objects() {
  dictionary_ = {};
  for (const auto& [address, entry] : can::profile_objects()) {
    if (can::size_of(entry.type) > 0) dictionary_.define(address, entry);
  }
  const auto limit = [this](ObjectAddress address, std::int64_t low, std::int64_t high) {
    can::ObjectEntry entry = can::profile_objects().at(address);
    entry.low_limit = low;
    entry.high_limit = high;
    dictionary_.define(address, entry, std::clamp<std::int64_t>(dictionary_.get(address), low, high));
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
  dictionary_.define_text(objects::kDeviceName, "device name", "Vantage simulated drive", false);
  dictionary_.define_text(kAxisLabel, "axis label", options_.label, true);
  using enum can::DataType;
  dictionary_.define(kTripObject, {"fault on demand", kUnsigned16, true, {}, {}, {}});
  dictionary_.define(kBlockObject, {"blocked motor", kUnsigned8, true, 0, 1, {}});
  dictionary_.define(kSilentObject, {"hanging electronics", kUnsigned8, true, 0, 1, {}});

  const std::pair<ObjectAddress, std::int64_t> values[] = {
      {objects::kDeviceType, 0x0002'0000 | 402},
      {{0x1005, 0}, can::kSyncId},
      {{0x1014, 0}, can::emergency_id(options_.node)},
      {{0x1016, 0}, 1},
      {{0x1018, 0}, 4},
      {objects::kVendor, 0x56414E54},  // "VANT"
      {objects::kProduct, 1},
      {objects::kRevision, 1},
      {objects::kSerial, options_.node},
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
  for (const auto& [address, value] : values) dictionary_.set(address, value);
  for (const PdoDirection direction : {PdoDirection::kToDrive, PdoDirection::kFromDrive}) {
    for (int pdo = 1; pdo <= 4; ++pdo) {
      const std::uint16_t parameters = can::pdo_parameters(direction, pdo);
      dictionary_.set({parameters, 0}, 2);
      dictionary_.set({parameters, 1}, can::pdo_id(direction, pdo, options_.node) | (pdo > 1 ? can::kPdoInvalid : 0U));
      dictionary_.set({parameters, 2}, 255);
      const std::uint16_t mapping = can::pdo_mapping(direction, pdo);
      dictionary_.set({mapping, 0}, 1);
      dictionary_.set({mapping, 1}, direction == PdoDirection::kToDrive ? 0x6040'0010 : 0x6041'0010);
    }
  }
  dictionary_.on_write([this](ObjectAddress address, std::int64_t value) { return judge(address, value); },
                       [this](ObjectAddress address, std::int64_t value) { written(address, value); });
}

std::optional<SdoAbort> SimDrive::judge(ObjectAddress address, std::int64_t value) const {
  if (is_mapping(address)) return judge_mapping(address, value);
  if (is_pdo_parameter(address) && address.sub == 1) {
    const auto now = static_cast<std::uint32_t>(dictionary_.get(address)), next = static_cast<std::uint32_t>(value);
    const bool in_use = (now & can::kPdoInvalid) == 0 && (next & can::kPdoInvalid) == 0;
    if (in_use && (now & 0x7FF) != (next & 0x7FF)) return SdoAbort::kBadValue;  // has to be switched off first
  }
  if (address == objects::kMode) {
    const auto modes = static_cast<std::uint32_t>(dictionary_.get(objects::kSupportedModes));
    if (value != 0 && (value < 0 || value > 10 || (modes >> (value - 1) & 1) == 0)) return SdoAbort::kBadValue;
  }
  return {};
}

std::optional<SdoAbort> SimDrive::judge_mapping(ObjectAddress address, std::int64_t value) const {
  const auto identifier = static_cast<std::uint32_t>(dictionary_.get(identifier_of(address)));
  if ((identifier & can::kPdoInvalid) == 0) return SdoAbort::kUnsupportedAccess;
  if (address.sub == 0) {
    if (value > 8) return SdoAbort::kBadValue;
    std::int64_t bits = 0;
    for (int sub = 1; sub <= value; ++sub)
      bits += dictionary_.get({address.index, static_cast<std::uint8_t>(sub)}) & 0xFF;
    return bits > 64 ? std::optional(SdoAbort::kMappingTooLong) : std::nullopt;
  }
  if (dictionary_.get({address.index, 0}) != 0) return SdoAbort::kUnsupportedAccess;
  if (value == 0) return {};
  const ObjectAddress mapped{static_cast<std::uint16_t>(value >> 16), static_cast<std::uint8_t>(value >> 8)};
  if (!dictionary_.has(mapped)) return SdoAbort::kNoObject;
  if ((value & 0xFF) != std::int64_t{8} * dictionary_.size_of(mapped)) return SdoAbort::kNotMappable;
  return {};
}

void SimDrive::written(ObjectAddress address, std::int64_t value) {
  if (address == objects::kMode) dictionary_.set(objects::kModeDisplay, value);
  if (address == objects::kControlword) obey_controlword();
  if (address == kTripObject && value != 0) trip(static_cast<std::uint16_t>(value));
  if (address == kBlockObject) motor_.block(value != 0);
  if (address == kSilentObject && value != 0) kill();
  if (address == objects::kProducerHeartbeat) next_heartbeat_ = now_;
  if (address == objects::kMasterHeartbeat) master_heard_ = nanoseconds(-1), master_lost_ = false;
}

void SimDrive::start(can::CanBus& bus) {
  alive_ = true;
  reset_node(bus);
}

void SimDrive::reset_node(can::CanBus& bus) {
  define_objects();
  nmt_ = NmtState::kPreOperational;
  state_ = DriveState::kNotReady;
  started_ = now_;
  origin_ = motor_.position();
  homed_ = has_target_ = profile_moving_ = set_point_taken_ = master_lost_ = emergency_waits_ = limited_ = false;
  homing_ = HomingPhase::kIdle;
  last_controlword_ = 0;
  master_heard_ = nanoseconds(-1);
  waiting_rpdo_ = {};
  bus.send(can::make_frame(can::heartbeat_id(options_.node), {static_cast<std::uint8_t>(NmtState::kBoot)}));
}

void SimDrive::obey_nmt(can::NmtCommand command, can::CanBus& bus) {
  switch (command) {
    case can::NmtCommand::kStart:
      nmt_ = NmtState::kOperational;
      break;
    case can::NmtCommand::kStop:
      nmt_ = NmtState::kStopped;
      if (state_ == DriveState::kOperationEnabled) enter(DriveState::kQuickStopActive);
      break;
    case can::NmtCommand::kPreOperational:
      nmt_ = NmtState::kPreOperational;
      has_target_ = false;
      break;
    case can::NmtCommand::kResetNode:
    case can::NmtCommand::kResetCommunication:
      reset_node(bus);
      return;
  }
  waiting_rpdo_ = {};
  next_heartbeat_ = now_;
}

void SimDrive::receive(const CanFrame& frame, can::CanBus& bus) {
  if (!alive_ || frame.error || frame.extended || frame.remote) return;
  if (frame.id == can::kNmtId) {
    if (frame.size == 2 && (frame.data[1] == 0 || frame.data[1] == options_.node)) {
      obey_nmt(static_cast<can::NmtCommand>(frame.data[0]), bus);
    }
    return;
  }
  if (frame.id == can::kSyncId) return on_sync(bus);
  if (frame.id == can::sdo_to_drive(options_.node)) {
    if (nmt_ != NmtState::kStopped) dictionary_.serve(frame, options_.node, bus);
    return;
  }
  const auto watched = static_cast<std::uint32_t>(dictionary_.get(objects::kMasterHeartbeat));
  if ((watched & 0xFFFF) != 0 && frame.id == can::heartbeat_id(static_cast<std::uint8_t>(watched >> 16 & 0x7F))) {
    master_heard_ = now_;
    if (std::exchange(master_lost_, false)) send_emergency(0, bus);
    return;
  }
  if (nmt_ != NmtState::kOperational) return;
  for (int pdo = 1; pdo <= 4; ++pdo) {
    const std::uint16_t parameters = can::pdo_parameters(PdoDirection::kToDrive, pdo);
    if (frame.id != static_cast<std::uint32_t>(dictionary_.get({parameters, 1}))) continue;
    if (dictionary_.get({parameters, 2}) <= kLastSyncType) {
      waiting_rpdo_[static_cast<std::size_t>(pdo - 1)] = frame;
    } else {
      apply_rpdo(pdo, frame.payload());
    }
  }
}

void SimDrive::on_sync(can::CanBus& bus) {
  if (nmt_ != NmtState::kOperational) return;
  for (int pdo = 1; pdo <= 4; ++pdo) {
    std::optional<CanFrame>& waiting = waiting_rpdo_[static_cast<std::size_t>(pdo - 1)];
    if (waiting) apply_rpdo(pdo, std::exchange(waiting, std::nullopt)->payload());
  }
  if (mode() == DriveMode::kCyclicPosition && state_ == DriveState::kOperationEnabled) {
    sync_target_ = demand_from(number(objects::kTargetPosition));
    sync_left_s_ = number(objects::kCyclePeriod) * std::pow(10, number(objects::kCycleExponent));
    has_target_ = true;
    limited_ = sync_target_ != number(objects::kTargetPosition) + origin_;
  }
  for (int pdo = 1; pdo <= 4; ++pdo) {
    const std::int64_t type = dictionary_.get({can::pdo_parameters(PdoDirection::kFromDrive, pdo), 2});
    if (type >= 1 && type <= kLastSyncType) send_tpdo(pdo, bus);
  }
}

/// A PDO is taken as a whole: the controlword acts when everything else is there.
void SimDrive::apply_rpdo(int pdo, std::span<const std::uint8_t> data) {
  const std::uint16_t mapping = can::pdo_mapping(PdoDirection::kToDrive, pdo);
  std::optional<std::int64_t> word;
  for (int sub = 1; sub <= dictionary_.get({mapping, 0}); ++sub) {
    const std::int64_t entry = dictionary_.get({mapping, static_cast<std::uint8_t>(sub)});
    const ObjectAddress object{static_cast<std::uint16_t>(entry >> 16), static_cast<std::uint8_t>(entry >> 8)};
    const auto bytes = static_cast<std::size_t>(entry & 0xFF) / 8;
    if (bytes > data.size()) break;
    const auto known = can::profile_objects().find(object);
    const bool with_sign = known != can::profile_objects().end() && can::is_signed(known->second.type);
    const std::int64_t value = can::get_number(data.first(bytes), with_sign);
    data = data.subspan(bytes);
    if (object == objects::kControlword) {
      word = value;
    } else {
      dictionary_.write(object, value);
    }
  }
  if (word) dictionary_.write(objects::kControlword, *word);
}

void SimDrive::send_tpdo(int pdo, can::CanBus& bus) {
  const std::uint16_t parameters = can::pdo_parameters(PdoDirection::kFromDrive, pdo);
  const auto identifier = static_cast<std::uint32_t>(dictionary_.get({parameters, 1}));
  if ((identifier & can::kPdoInvalid) != 0) return;
  dictionary_.set(objects::kStatusword, statusword());
  dictionary_.set(objects::kActualPosition, actual_position());
  dictionary_.set(objects::kActualVelocity, std::lround(motor_.speed()));
  dictionary_.set(objects::kFollowingError, std::lround(demand_ - motor_.position()));
  CanFrame frame = can::make_frame(identifier & 0x7FF, {});
  const std::uint16_t mapping = can::pdo_mapping(PdoDirection::kFromDrive, pdo);
  for (int sub = 1; sub <= dictionary_.get({mapping, 0}); ++sub) {
    const std::int64_t entry = dictionary_.get({mapping, static_cast<std::uint8_t>(sub)});
    const ObjectAddress object{static_cast<std::uint16_t>(entry >> 16), static_cast<std::uint8_t>(entry >> 8)};
    const int bytes = static_cast<int>(entry & 0xFF) / 8;
    can::put_number(dictionary_.get(object), bytes, frame.data.data() + frame.size);
    frame.size = static_cast<std::uint8_t>(frame.size + bytes);
  }
  bus.send(frame);
}

DriveMode SimDrive::mode() const { return static_cast<DriveMode>(dictionary_.get(objects::kModeDisplay)); }

std::int32_t SimDrive::actual_position() const {
  return static_cast<std::int32_t>(std::lround(motor_.position() - origin_));
}

/// A target in the drive's own coordinates, cut to 607D, on the machine's scale.
double SimDrive::demand_from(double target) const {
  const double low = number(objects::kLowestPosition), high = number(objects::kHighestPosition);
  const double cut = homed_ && low < high ? std::clamp(target, low, high) : target;
  return cut + origin_;
}

std::uint16_t SimDrive::statusword() const {
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

void SimDrive::enter(DriveState state) {
  if (state == state_) return;
  state_ = state;
  demand_ = motor_.position();
  demand_speed_ = state == DriveState::kOperationEnabled ? 0 : motor_.speed();
  has_target_ = profile_moving_ = false;
  following_time_s_ = 0;
  if (homing_ == HomingPhase::kToSwitch || homing_ == HomingPhase::kOffSwitch) homing_ = HomingPhase::kFailed;
  if (state == DriveState::kOperationEnabled) homing_ = HomingPhase::kIdle;
}

void SimDrive::obey_controlword() {
  const auto word = static_cast<std::uint16_t>(dictionary_.get(objects::kControlword));
  const std::uint16_t risen = static_cast<std::uint16_t>(word & ~last_controlword_);
  const std::uint16_t fallen = static_cast<std::uint16_t>(last_controlword_ & ~word);
  last_controlword_ = word;
  if (state_ == DriveState::kFault) {
    if ((risen & controlword::kFaultReset) != 0) {
      dictionary_.set(objects::kErrorCode, 0);
      dictionary_.set(objects::kErrorRegister, 0);
      pending_emergency_ = 0;
      emergency_waits_ = true;
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

void SimDrive::trip(std::uint16_t code) {
  if (state_ == DriveState::kFault || state_ == DriveState::kFaultReaction) return;
  dictionary_.set(objects::kErrorCode, code);
  dictionary_.set(objects::kErrorRegister, code >> 8 == 0x81 ? 0x11 : 0x21);
  dictionary_.set({0x1003, 0}, 1);
  dictionary_.set(objects::kErrorHistory, code);
  pending_emergency_ = code;
  emergency_waits_ = true;
  const bool moving = state_ == DriveState::kOperationEnabled || state_ == DriveState::kQuickStopActive;
  enter(moving ? DriveState::kFaultReaction : DriveState::kFault);
}

void SimDrive::send_emergency(std::uint16_t code, can::CanBus& bus) {
  bus.send(can::make_frame(can::emergency_id(options_.node),
                           {static_cast<std::uint8_t>(code), static_cast<std::uint8_t>(code >> 8),
                            static_cast<std::uint8_t>(dictionary_.get(objects::kErrorRegister)), 0, 0, 0, 0, 0}));
}

void SimDrive::watch_master(can::CanBus& bus) {
  const auto watched = static_cast<std::uint32_t>(dictionary_.get(objects::kMasterHeartbeat));
  const nanoseconds limit = std::chrono::milliseconds(watched & 0xFFFF);
  if (limit == nanoseconds(0) || master_heard_ < nanoseconds(0) || master_lost_ || now_ - master_heard_ <= limit)
    return;
  master_lost_ = true;
  send_emergency(kTripByMaster, bus);
  switch (dictionary_.get(objects::kConnectionLossReaction)) {
    case 1:
      trip(kTripCommunication);
      break;
    case 2:
      enter(DriveState::kSwitchOnDisabled);
      break;
    case 3:
      if (state_ == DriveState::kOperationEnabled) enter(DriveState::kQuickStopActive);
      break;
    default:
      break;
  }
}

void SimDrive::send_heartbeat_if_due(can::CanBus& bus) {
  const nanoseconds period = std::chrono::milliseconds(dictionary_.get(objects::kProducerHeartbeat));
  if (period == nanoseconds(0) || now_ < next_heartbeat_) return;
  next_heartbeat_ = now_ + period;
  bus.send(can::make_frame(can::heartbeat_id(options_.node), {static_cast<std::uint8_t>(nmt_)}));
}

void SimDrive::advance(nanoseconds now, can::CanBus& bus) {
  double left = seconds_of(now - now_);
  now_ = now;
  while (left > 0) {
    const double dt = std::min(left, kLongestStep);
    step(dt);
    left -= dt;
  }
  if (!alive_) return;
  if (state_ == DriveState::kNotReady && now_ - started_ >= kBootTime) enter(DriveState::kSwitchOnDisabled);
  watch_master(bus);
  if (std::exchange(emergency_waits_, false)) send_emergency(pending_emergency_, bus);
  send_heartbeat_if_due(bus);
}

void SimDrive::step(double dt) {
  if (!alive_) return motor_.coast(dt);
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
bool SimDrive::brake(double dt) {
  const double change = number(objects::kQuickStopDeceleration) * dt;
  demand_speed_ -= std::clamp(demand_speed_, -change, change);
  demand_ += demand_speed_ * dt;
  motor_.follow(demand_, demand_speed_, dt);
  return demand_speed_ == 0 && std::abs(motor_.speed()) < kStandstill;
}

void SimDrive::operate(double dt) {
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
void SimDrive::operate_profile(double dt) {
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
void SimDrive::operate_homing(double dt) {
  const std::int64_t method = dictionary_.get(objects::kHomingMethod);
  const double towards = method == 17 ? -1 : 1;
  const bool closed =
      method == 17 ? motor_.position() <= options_.negative_switch : motor_.position() >= options_.positive_switch;
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

void SimDrive::finish_homing() {
  const std::int64_t method = dictionary_.get(objects::kHomingMethod);
  // The switch's edge itself, which a drive latches between two steps of its servo.
  double edge = motor_.position();
  if (method == 17) edge = options_.negative_switch;
  if (method == 18) edge = options_.positive_switch;
  origin_ = edge - number(objects::kHomeOffset);
  homed_ = true;
  homing_ = HomingPhase::kDone;
}

void SimDrive::watch_following_error(double dt) {
  if (mode() == DriveMode::kCyclicVelocity || mode() == DriveMode::kProfileVelocity) return;
  following_warning_ = std::abs(demand_ - motor_.position()) > number(objects::kFollowingErrorWindow);
  following_time_s_ = following_warning_ ? following_time_s_ + dt : 0;
  if (following_time_s_ * 1000 > number(objects::kFollowingErrorTime)) trip(kTripFollowing);
}

}  // namespace vantage::sim
