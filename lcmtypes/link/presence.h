#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include <vantage/heartbeat_t.hpp>

#include "lcmtypes/link/clock.h"
#include "lcmtypes/link/message_bus.h"
#include "lcmtypes/link/peer_clock.h"

namespace vantage {

enum class Role : std::int8_t { kRobot = 0, kPlanner = 1 };

/// How the program on the other side is.
enum class PeerPhase {
  kAwaited,  ///< not heard yet
  kRunning,
  kUnfit,     ///< it lives, but speaks another version of the link; `peer_message` says which
  kFinished,  ///< it said that its work is done
  kFailed,    ///< it said that it had to give up
  kLost       ///< silent for longer than it may be
};

struct PresenceOptions {
  std::chrono::milliseconds period{250};
  std::chrono::milliseconds lost_after{3000};
  std::int32_t link_version = kLinkVersion;  ///< for tests: what another release would say
};

/// Tells the other side that this program lives, and knows whether the other side does, which start of it, in which
/// version, and what its clock says.
class Presence {
 public:
  Presence(MessageBus& bus, const Clock& clock, Role role, std::string version, PresenceOptions options = {});

  /// Sends the heartbeat when it is due. Call it often; one that is never called listens only.
  void step();

  /// The last word of this program: sent at once, three times, for datagrams get lost.
  void say_finished(const std::string& message);
  void say_failed(const std::string& message);

  PeerPhase peer() const;
  /// Why the peer finished, failed or does not fit.
  const std::string& peer_message() const { return peer_message_; }
  const std::string& peer_version() const { return peer_version_; }
  /// Of the peer's start that was heard last; 0: none yet.
  std::int64_t peer_boot_id() const { return peer_boot_id_; }
  /// How often a peer that had been heard came back as another start of its program.
  std::uint64_t peer_restarts() const { return peer_restarts_; }
  /// Of the last command that the peer (a robot) took.
  std::int64_t peer_command_counter() const { return peer_command_counter_; }
  /// What the peer's clock shows now, us since 1970: never ahead of it, behind by what its latest heartbeat took.
  std::optional<std::int64_t> peer_utime() const;
  /// Nothing before a heartbeat of each side has been answered by the other's.
  std::optional<ClockOffset> clock_offset() const { return clock_offset_.offset(); }

  std::int64_t boot_id() const { return boot_id_; }
  /// A robot says with each heartbeat which command it took last.
  void set_command_counter(std::int64_t counter) { command_counter_ = counter; }
  const DecodeCounters& decode_counters() const { return decode_; }

 private:
  void send(std::int8_t phase, const std::string& message);
  void on_heartbeat(const heartbeat_t& heartbeat);

  MessageBus& bus_;
  const Clock& clock_;
  Role role_;
  std::string version_;
  PresenceOptions options_;
  DecodeCounters decode_;
  std::int64_t boot_id_;
  std::int64_t command_counter_ = 0;
  std::chrono::nanoseconds last_sent_{0}, last_heard_{0};
  bool sent_ = false;
  PeerPhase peer_ = PeerPhase::kAwaited;
  std::string peer_message_, peer_version_;
  std::int64_t peer_boot_id_ = 0, peer_command_counter_ = 0;
  std::uint64_t peer_restarts_ = 0;
  std::int64_t peer_sent_ = 0, peer_heard_at_ = 0;  // the latest heartbeat, by the peer's and by our clock
  PeerClock clock_offset_;
};

}  // namespace vantage
