#include "drivers/sim/sim_drive.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "drivers/can/emergency.h"
#include "drivers/can/sdo_transfer.h"

namespace vantage::sim {
namespace {

using can::CanFrame;
using can::NmtState;
using can::ObjectAddress;
using can::PdoDirection;
using can::SdoAbort;
using std::chrono::nanoseconds;
namespace objects = can::objects;

constexpr nanoseconds kBootTime = std::chrono::milliseconds(50);  // from switching on to "switch on disabled"
constexpr double kLongestStep = 1e-3;                             // s, of the motor's integration
constexpr std::uint8_t kLastSyncType = 240;

constexpr std::uint16_t kMasterLost = 0x8130, kTripCommunication = 0x8100;

double seconds_of(nanoseconds time) { return std::chrono::duration<double>(time).count(); }

bool is_mapping(ObjectAddress a) { return (a.index & 0xFFFC) == 0x1600 || (a.index & 0xFFFC) == 0x1A00; }
bool is_pdo_parameter(ObjectAddress a) { return (a.index & 0xFFFC) == 0x1400 || (a.index & 0xFFFC) == 0x1800; }

/// The identifier entry of the PDO that a mapping belongs to.
ObjectAddress identifier_of(ObjectAddress mapping) { return {static_cast<std::uint16_t>(mapping.index - 0x200), 1}; }

}  // namespace

SimDrive::SimDrive(const SimDriveOptions& options, nanoseconds now)
    : options_(options), axis_(dictionary_, options.motor, options.switches), now_(now), started_(now) {
  define_objects();
}

void SimDrive::define_objects() {
  dictionary_ = {};
  define_drive_objects(&dictionary_, options_.node, options_.label);
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
  if (address == objects::kControlword) axis_.obey_controlword();
  if (address == kTripObject && value != 0) axis_.trip(static_cast<std::uint16_t>(value));
  if (address == kBlockObject) axis_.block_motor(value != 0);
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
  started_ = now_;
  axis_.switch_on();
  master_lost_ = false;
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
      axis_.quick_stop();
      break;
    case can::NmtCommand::kPreOperational:
      nmt_ = NmtState::kPreOperational;
      axis_.forget_target();
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
  axis_.on_sync();
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
  axis_.measure();
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
  send_emergency(kMasterLost, bus);
  switch (dictionary_.get(objects::kConnectionLossReaction)) {
    case 1:
      axis_.trip(kTripCommunication);
      break;
    case 2:
      axis_.disable_voltage();
      break;
    case 3:
      axis_.quick_stop();
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
    alive_ ? axis_.step(dt) : axis_.coast(dt);
    left -= dt;
  }
  if (!alive_) return;
  if (now_ - started_ >= kBootTime) axis_.get_ready();
  watch_master(bus);
  if (const auto code = axis_.take_emergency()) send_emergency(*code, bus);
  send_heartbeat_if_due(bus);
}

}  // namespace vantage::sim
