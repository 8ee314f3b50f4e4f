#pragma once

#include <cstdint>
#include <string>

#include <vantage/heartbeat_t.hpp>

#include "lcmtypes/link/clock.h"
#include "lcmtypes/link/message_bus.h"

namespace vantage {

enum class Role : std::int8_t { kRobot = 0, kPlanner = 1 };

/// How the program on the other side is.
enum class PeerPhase {
  kAwaited,  ///< not heard yet
  kRunning,
  kFinished,  ///< it said that its work is done
  kFailed,    ///< it said that it had to give up
  kLost       ///< silent for longer than it may be
};

struct PresenceOptions {
  std::chrono::milliseconds period{250};
  std::chrono::milliseconds lost_after{3000};
};

/// Tells the other side that this program lives, and knows whether the other side does.
class Presence {
 public:
  Presence(MessageBus& bus, const Clock& clock, Role role, std::string version, PresenceOptions options = {});

  /// Sends the heartbeat when it is due. Call it often.
  void step();

  /// The last word of this program: sent at once, three times, for datagrams get lost.
  void say_finished(const std::string& message);
  void say_failed(const std::string& message);

  PeerPhase peer() const;
  /// Why the peer finished or failed, in its own words.
  const std::string& peer_message() const { return peer_message_; }
  std::int64_t boot_id() const { return boot_id_; }

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
  std::chrono::nanoseconds last_sent_{0}, last_heard_{0};
  bool sent_ = false;
  PeerPhase peer_ = PeerPhase::kAwaited;
  std::string peer_message_;
};

}  // namespace vantage
