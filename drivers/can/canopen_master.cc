#include "drivers/can/canopen_master.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

namespace vantage::can {
namespace {

using std::chrono::nanoseconds;

constexpr int kSdoTries = 2;  // an answer may be lost, but hardly two in a row

/// The range of a number type.
std::pair<std::int64_t, std::int64_t> range_of(DataType type) {
  const int bits = 8 * size_of(type);
  if (is_signed(type)) return {-(std::int64_t{1} << (bits - 1)), (std::int64_t{1} << (bits - 1)) - 1};
  return {0, (std::int64_t{1} << bits) - 1};
}

/// The entry of a number in `objects`, else in the profile's table.
const ObjectEntry* find_number(const ObjectMap& objects, const ObjectAddress& object) {
  for (const ObjectMap* map : {&objects, &profile_objects()}) {
    const auto found = map->find(object);
    if (found != map->end() && size_of(found->second.type) > 0) return &found->second;
  }
  return nullptr;
}

}  // namespace

bool MasterOptions::valid(std::string* why) const {
  const auto fail = [why](const char* reason) {
    if (why != nullptr) *why = reason;
    return false;
  };
  if (node < 1 || node > kLastNode) return fail("the master's node must be 1 to 127");
  if (heartbeat_period <= nanoseconds(0)) return fail("heartbeat_period must be positive");
  if (sdo_timeout <= nanoseconds(0)) return fail("sdo_timeout must be positive");
  return true;
}

std::string to_text(const BusFaults& faults) {
  const auto times = [](std::uint64_t count) { return count > 1 ? " (" + std::to_string(count) + " times)" : ""; };
  if (faults.gone != 0) return "the bus is gone";
  if (faults.bus_off != 0) return to_text(faults.last);
  if (faults.down != 0) return "the interface is set down";
  if (faults.restarted != 0) return "the controller was restarted; every drive has to be set up again";
  if (faults.queue_full != 0) {
    return "the transmit queue is full" + times(faults.queue_full) +
           ": nobody acknowledges, the bus is overloaded or its txqueuelen too small";
  }
  if (faults.overflowed != 0) return std::to_string(faults.overflowed) + " frames were lost on receipt";
  if (faults.no_acknowledge != 0 || faults.transmit_timeout != 0) return to_text(faults.last);
  return "";
}

CanopenMaster::CanopenMaster(CanBus& bus, const Clock& clock, const MasterOptions& options)
    : bus_(bus), clock_(clock), options_(options) {
  std::string why;
  if (!options.valid(&why)) throw std::invalid_argument("CanopenMaster: " + why);
  bus_.accept_only({});
  overflow_base_ = bus_.counters().overflowed;
}

void CanopenMaster::listen_to(std::uint8_t node) {
  if (node < 1 || node > kLastNode) throw std::invalid_argument("CanopenMaster: a node is 1 to 127");
  if (std::exchange(known_[node], true)) return;
  ids_.insert(ids_.end(), {heartbeat_id(node), emergency_id(node), sdo_from_drive(node)});
  for (int number = 1; number <= 4; ++number) ids_.push_back(pdo_id(PdoDirection::kFromDrive, number, node));
  bus_.accept_only(ids_);
}

bool CanopenMaster::send(const CanFrame& frame) {
  switch (bus_.send(frame)) {
    case SendResult::kSent:
      return true;
    case SendResult::kQueueFull:
      ++faults_.queue_full;
      return false;
    case SendResult::kDown:
      ++faults_.down;
      return false;
    case SendResult::kGone:
      ++faults_.gone;
      return false;
  }
  return false;
}

void CanopenMaster::send_heartbeat_if_due() {
  const nanoseconds now = clock_.monotonic();
  if (now < next_heartbeat_) return;
  // After a stall the next one is due a period from now: what was missed is not made up for.
  next_heartbeat_ = std::max(next_heartbeat_ + options_.heartbeat_period, now + options_.heartbeat_period / 2);
  send(make_frame(heartbeat_id(options_.node), {static_cast<std::uint8_t>(NmtState::kOperational)}));
}

void CanopenMaster::poll() {
  CanFrame frame;
  bool more = true;
  while (more) {
    switch (bus_.receive(&frame)) {
      case ReceiveResult::kFrame:
        take(frame);
        continue;
      case ReceiveResult::kNothing:
        break;
      case ReceiveResult::kDown:
        ++faults_.down;
        break;
      case ReceiveResult::kGone:
        ++faults_.gone;
        break;
    }
    more = false;
  }
  const std::uint64_t overflowed = bus_.counters().overflowed;
  faults_.overflowed += overflowed - std::exchange(overflow_base_, overflowed);
  send_heartbeat_if_due();
}

void CanopenMaster::poll_until(nanoseconds deadline) {
  poll();
  while (clock_.monotonic() < deadline) {
    bus_.wait_until(std::min(deadline, next_heartbeat_));
    poll();
  }
}

void CanopenMaster::sleep_until(nanoseconds deadline) {
  while (next_heartbeat_ < deadline) {
    bus_.sleep_until(next_heartbeat_);
    poll();
  }
  bus_.sleep_until(deadline);
  poll();
}

void CanopenMaster::take(const CanFrame& frame) {
  if (frame.error) return take_error(frame);
  if (frame.extended || frame.remote || frame.id > 0x7FF) return;
  const auto node = static_cast<std::uint8_t>(frame.id & 0x7F);
  if (!known_[node]) return;
  NodeStatus& status = nodes_[node];
  switch (frame.id & 0x780) {
    case 0x700:
      if (frame.size != 1) return;
      status.heard = true;
      status.state = static_cast<NmtState>(frame.data[0] & 0x7F);
      status.last_heartbeat = frame.time;
      if (status.state == NmtState::kBoot) ++status.boots;
      return;
    case 0x080:
      if (read_emergency(frame, &status.emergency)) ++status.emergencies;
      return;
    case 0x580:
      if (transfer_ != nullptr) {
        const SdoTransfer::Step step = transfer_->answer(frame);
        if (step != SdoTransfer::Step::kIgnored) transfer_step_ = step;
      }
      return;
    case 0x180:
    case 0x280:
    case 0x380:
    case 0x480: {
      ReceivedPdo& pdo = pdos_[node][(frame.id >> 8) - 1];
      pdo.data = frame.data;
      pdo.size = frame.size;
      pdo.time = frame.time;
      ++pdo.count;
      return;
    }
    default:
      return;
  }
}

void CanopenMaster::take_error(const CanFrame& frame) {
  BusError error;
  if (!read_bus_error(frame, &error)) return;
  if (error.breaks_bus()) faults_.last = error;
  faults_.bus_off += error.bus_off ? 1 : 0;
  faults_.restarted += error.restarted ? 1 : 0;
  faults_.no_acknowledge += error.no_acknowledge ? 1 : 0;
  faults_.transmit_timeout += error.transmit_timeout ? 1 : 0;
}

bool CanopenMaster::send_nmt(NmtCommand command, std::uint8_t node) {
  return send(make_frame(kNmtId, {static_cast<std::uint8_t>(command), node}));
}

bool CanopenMaster::send_sync() { return send(make_frame(kSyncId, {})); }

bool CanopenMaster::send_pdo(std::uint32_t id, std::span<const std::uint8_t> data) {
  return send(make_frame(id, data));
}

const ReceivedPdo& CanopenMaster::received(int number, std::uint8_t node) const {
  return pdos_[node][static_cast<std::size_t>(number - 1)];
}

void CanopenMaster::forget(std::uint8_t node) {
  nodes_[node].heard = false;
  pdos_[node] = {};
}

void CanopenMaster::clear_bus_faults() { faults_ = {}; }

SdoOutcome CanopenMaster::run(SdoTransfer& transfer, std::uint8_t node, const char* what) {
  const std::string title = std::string(what) + " " + to_text(transfer.object()) + ": ";
  const auto fail = [&](const std::string& why, std::uint32_t code) {
    transfer_ = nullptr;
    return SdoOutcome{title + why, code};
  };
  listen_to(node);
  poll();  // what is left of an earlier transfer
  transfer_ = &transfer;
  while (true) {
    transfer_step_ = SdoTransfer::Step::kIgnored;
    if (!send(transfer.request())) return fail(to_text(faults_), 0);
    const nanoseconds deadline = clock_.monotonic() + options_.sdo_timeout;
    while (transfer_step_ == SdoTransfer::Step::kIgnored && clock_.monotonic() < deadline) {
      bus_.wait_until(std::min(deadline, next_heartbeat_));
      poll();
    }
    switch (transfer_step_) {
      case SdoTransfer::Step::kSend:
        continue;
      case SdoTransfer::Step::kDone:
        transfer_ = nullptr;
        return {};
      case SdoTransfer::Step::kFailed:
        if (transfer.request().size != 0) send(transfer.request());
        return fail(sdo_abort_text(transfer.abort_code()), transfer.abort_code());
      case SdoTransfer::Step::kIgnored:
        break;
    }
    const auto code = static_cast<std::uint32_t>(SdoAbort::kTimedOut);
    return fail(sdo_abort_text(code), code);
  }
}

SdoOutcome CanopenMaster::read(std::uint8_t node, ObjectAddress object, std::vector<std::uint8_t>* data) {
  SdoOutcome outcome;
  for (int attempt = 0; attempt < kSdoTries; ++attempt) {
    SdoTransfer transfer = SdoTransfer::reading(node, object);
    outcome = run(transfer, node, "reading");
    if (outcome.ok()) *data = transfer.data();
    if (outcome.abort_code != static_cast<std::uint32_t>(SdoAbort::kTimedOut)) break;
  }
  return outcome;
}

SdoOutcome CanopenMaster::read_number(std::uint8_t node, ObjectAddress object, std::int64_t* value) {
  std::vector<std::uint8_t> data;
  SdoOutcome outcome = read(node, object, &data);
  if (!outcome.ok()) return outcome;
  if (data.empty() || data.size() > 8) {
    outcome.fault = "reading " + to_text(object) + ": the drive sent " + std::to_string(data.size()) +
                    " bytes where a number belongs";
    return outcome;
  }
  const ObjectEntry* entry = find_number(profile_objects(), object);
  *value = get_number(data, entry != nullptr && is_signed(entry->type));
  return outcome;
}

SdoOutcome CanopenMaster::write(std::uint8_t node, ObjectAddress object, std::span<const std::uint8_t> data) {
  SdoOutcome outcome;
  for (int attempt = 0; attempt < kSdoTries; ++attempt) {
    SdoTransfer transfer = SdoTransfer::writing(node, object, data);
    outcome = run(transfer, node, "writing");
    if (outcome.abort_code != static_cast<std::uint32_t>(SdoAbort::kTimedOut)) break;
  }
  return outcome;
}

SdoOutcome CanopenMaster::write_number(std::uint8_t node, ObjectAddress object, std::int64_t value,
                                       const ObjectMap& objects) {
  const auto fail = [&](const std::string& why) {
    return SdoOutcome{"writing " + std::to_string(value) + " to " + to_text(object) + ": " + why, 0};
  };
  const ObjectEntry* entry = find_number(objects, object);
  if (entry == nullptr) return fail("the object's type is not known");
  auto [low, high] = range_of(entry->type);
  if (entry->low_limit) low = std::max(low, *entry->low_limit);
  if (entry->high_limit) high = std::min(high, *entry->high_limit);
  if (value < low || value > high) {
    return fail("the drive takes " + std::to_string(low) + " to " + std::to_string(high));
  }
  std::array<std::uint8_t, 8> bytes{};
  const int size = size_of(entry->type);
  put_number(value, size, bytes.data());
  return write(node, object, std::span(bytes).first(static_cast<std::size_t>(size)));
}

SdoOutcome CanopenMaster::write_verified(std::uint8_t node, ObjectAddress object, std::int64_t value,
                                         const ObjectMap& objects) {
  SdoOutcome outcome = write_number(node, object, value, objects);
  if (!outcome.ok()) return outcome;
  std::vector<std::uint8_t> data;
  outcome = read(node, object, &data);
  if (!outcome.ok()) return outcome;
  const ObjectEntry* entry = find_number(objects, object);
  const std::int64_t kept = get_number(data, is_signed(entry->type));
  if (data.size() != static_cast<std::size_t>(size_of(entry->type)) || kept != value) {
    outcome.fault = "writing " + to_text(object) + ": the drive keeps " + std::to_string(kept) + " (" +
                    std::to_string(data.size()) + " bytes) instead of " + std::to_string(value);
  }
  return outcome;
}

SdoOutcome CanopenMaster::set_up_pdo(std::uint8_t node, const PdoConfig& config, const ObjectMap& objects) {
  const std::uint16_t parameters = pdo_parameters(config.direction, config.number);
  const std::uint16_t mapping = pdo_mapping(config.direction, config.number);
  const std::uint32_t id = pdo_id(config.direction, config.number, node);
  struct Step {
    ObjectAddress object;
    std::int64_t value;
    bool verify;
  };
  std::vector<Step> steps{{{parameters, 1}, static_cast<std::int64_t>(id | kPdoInvalid), false},
                          {{parameters, 2}, config.transmission_type, true},
                          {{mapping, 0}, 0, true}};
  std::uint8_t sub = 0;
  for (const MappedObject& mapped : config.objects) {
    steps.push_back({{mapping, ++sub}, static_cast<std::int64_t>(mapping_entry(mapped)), true});
  }
  steps.push_back({{mapping, 0}, sub, true});
  for (const Step& step : steps) {
    SdoOutcome outcome = step.verify ? write_verified(node, step.object, step.value, objects)
                                     : write_number(node, step.object, step.value, objects);
    if (!outcome.ok()) return outcome;
  }
  // Bit 30 is the drive's own (no remote frames); the identifier and bit 31 are not.
  SdoOutcome outcome = write_number(node, {parameters, 1}, id, objects);
  std::int64_t kept = 0;
  if (outcome.ok()) outcome = read_number(node, {parameters, 1}, &kept);
  if (outcome.ok() && (static_cast<std::uint32_t>(kept) & ~0x4000'0000U) != id) {
    outcome.fault = "writing " + to_text(ObjectAddress{parameters, 1}) + ": the drive keeps another identifier";
  }
  return outcome;
}

SdoOutcome CanopenMaster::switch_off_pdo(std::uint8_t node, PdoDirection direction, int number) {
  const ObjectAddress object{pdo_parameters(direction, number), 1};
  SdoOutcome outcome =
      write_number(node, object, static_cast<std::int64_t>(pdo_id(direction, number, node) | kPdoInvalid));
  const auto absent = [&](SdoAbort code) { return outcome.abort_code == static_cast<std::uint32_t>(code); };
  return absent(SdoAbort::kNoObject) || absent(SdoAbort::kNoSubindex) ? SdoOutcome{} : outcome;
}

}  // namespace vantage::can
