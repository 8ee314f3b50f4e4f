#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "drivers/can/bus_error.h"
#include "drivers/can/can_bus.h"
#include "drivers/can/emergency.h"
#include "drivers/can/nmt.h"
#include "drivers/can/object_table.h"
#include "drivers/can/pdo.h"
#include "drivers/can/sdo_transfer.h"
#include "lcmtypes/link/clock.h"

namespace vantage::can {

struct MasterOptions {
  std::uint8_t node = kLastNode;  ///< the master's own, of its heartbeat
  std::chrono::nanoseconds heartbeat_period{20'000'000};
  std::chrono::nanoseconds sdo_timeout{200'000'000};  ///< for each answer of a drive

  /// False, with the reason in `why`, when the values make no sense.
  bool valid(std::string* why = nullptr) const;
};

/// What the master has heard of a node.
struct NodeStatus {
  bool heard = false;
  NmtState state = NmtState::kBoot;
  std::chrono::nanoseconds last_heartbeat{0};
  std::uint32_t boots = 0;  ///< boot-up messages: a drive that boots again has forgotten its set-up
  Emergency emergency;      ///< the last one
  std::uint32_t emergencies = 0;
};

/// The last content of a PDO from a drive.
struct ReceivedPdo {
  std::array<std::uint8_t, 8> data{};
  std::uint8_t size = 0;
  std::chrono::nanoseconds time{0};
  std::uint64_t count = 0;
};

/// What has befallen the bus since `clear_bus_faults`.
struct BusFaults {
  std::uint32_t queue_full = 0;  ///< ENOBUFS: the controller does not get rid of its frames
  std::uint32_t down = 0, gone = 0;
  std::uint32_t bus_off = 0, restarted = 0, no_acknowledge = 0, transmit_timeout = 0;
  std::uint64_t overflowed = 0;  ///< frames lost on receipt
  BusError last;                 ///< of the controller

  bool any() const {
    return queue_full != 0 || down != 0 || gone != 0 || bus_off != 0 || restarted != 0 || no_acknowledge != 0 ||
           transmit_timeout != 0 || overflowed != 0;
  }
};

/// The worst of them in words; empty when there is none.
std::string to_text(const BusFaults& faults);

/// The end of a service data object's transfer. Empty `fault`: it went well.
struct SdoOutcome {
  std::string fault;             ///< "reading 6041 (statusword): no answer in time (abort 0x05040000)"
  std::uint32_t abort_code = 0;  ///< 0: none, also when the bus failed
  bool ok() const { return fault.empty(); }
};

/// The master of a CANopen bus (CiA 301): network management, objects by SDO, process data at every SYNC, heartbeats
/// both ways, emergencies.
///
/// No thread of its own: the master's heartbeat goes out while its owner calls `poll`, and ends with it, so that drives
/// which watch it stop by themselves. `poll`, `send_pdo`, `send_sync` and `received` allocate nothing and never wait;
/// all else is for setting up.
class CanopenMaster {
 public:
  /// Both must outlive it. \throws std::invalid_argument for options that are not valid.
  CanopenMaster(CanBus& bus, const Clock& clock, const MasterOptions& options = {});

  /// A node that the master listens to: heartbeat, emergencies, SDO answers, PDOs 1 to 4. \pre node is 1 to 127.
  void listen_to(std::uint8_t node);

  /// Takes all that came in, and sends the heartbeat when it is due.
  void poll();
  /// Polls until `deadline`; in the meantime wakes for what comes in.
  void poll_until(std::chrono::nanoseconds deadline);
  /// Lets time pass, then polls: for a cycle, which needs no waking in between.
  void sleep_until(std::chrono::nanoseconds deadline);

  bool send_nmt(NmtCommand command, std::uint8_t node);
  bool send_sync();
  bool send_pdo(std::uint32_t id, std::span<const std::uint8_t> data);

  /// Reads an object. Waits for each answer at most `sdo_timeout`.
  SdoOutcome read(std::uint8_t node, ObjectAddress object, std::vector<std::uint8_t>* data);
  SdoOutcome read_number(std::uint8_t node, ObjectAddress object, std::int64_t* value);
  SdoOutcome write(std::uint8_t node, ObjectAddress object, std::span<const std::uint8_t> data);
  /// Writes a number in the type that `objects` give the object. Out of its type's or its limits' range: a fault, and
  /// nothing is sent.
  SdoOutcome write_number(std::uint8_t node, ObjectAddress object, std::int64_t value,
                          const ObjectMap& objects = profile_objects());
  /// Writes a number, reads it back and compares.
  SdoOutcome write_verified(std::uint8_t node, ObjectAddress object, std::int64_t value,
                            const ObjectMap& objects = profile_objects());
  /// Sets a PDO up, in the order that CiA 301 asks for, and reads all of it back. The node should be pre-operational.
  SdoOutcome set_up_pdo(std::uint8_t node, const PdoConfig& config, const ObjectMap& objects = profile_objects());
  /// Takes a PDO out of use. A drive without it is as good.
  SdoOutcome switch_off_pdo(std::uint8_t node, PdoDirection direction, int number);

  const NodeStatus& node(std::uint8_t node) const { return nodes_[node]; }
  const ReceivedPdo& received(int number, std::uint8_t node) const;
  /// Waits for a node's next heartbeat and PDOs as if none had been heard; boots and emergencies stay counted.
  void forget(std::uint8_t node);

  const BusFaults& bus_faults() const { return faults_; }
  void clear_bus_faults();
  CanBus& bus() { return bus_; }
  const Clock& clock() const { return clock_; }
  const MasterOptions& options() const { return options_; }

 private:
  bool send(const CanFrame& frame);
  void take(const CanFrame& frame);
  void take_error(const CanFrame& frame);
  void send_heartbeat_if_due();
  SdoOutcome run(SdoTransfer& transfer, std::uint8_t node, const char* what);

  CanBus& bus_;
  const Clock& clock_;
  MasterOptions options_;
  std::vector<std::uint32_t> ids_;
  std::array<NodeStatus, kLastNode + 1> nodes_{};
  std::array<std::array<ReceivedPdo, 4>, kLastNode + 1> pdos_{};
  std::array<bool, kLastNode + 1> known_{};
  std::chrono::nanoseconds next_heartbeat_{0};
  BusFaults faults_;
  std::uint64_t overflow_base_ = 0;
  SdoTransfer* transfer_ = nullptr;  // the one that waits for an answer
  SdoTransfer::Step transfer_step_ = SdoTransfer::Step::kIgnored;
};

}  // namespace vantage::can
