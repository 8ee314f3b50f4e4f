#include "lcmtypes/link/presence.h"

#include <utility>

#include "lcmtypes/link/digest.h"

namespace vantage {
namespace {

constexpr std::int8_t kRunningCode = 0, kFinishedCode = 1, kFailedCode = 2;
constexpr int kLastWords = 3;

}  // namespace

Presence::Presence(MessageBus& bus, const Clock& clock, Role role, std::string version, PresenceOptions options)
    : bus_(bus), clock_(clock), role_(role), version_(std::move(version)), options_(options), boot_id_(random_id()) {
  subscribe_message<heartbeat_t>(bus_, channel::kHeartbeat, &decode_,
                                 [this](const heartbeat_t& heartbeat) { on_heartbeat(heartbeat); });
}

void Presence::step() {
  const std::chrono::nanoseconds now = clock_.monotonic();
  if (sent_ && now - last_sent_ < options_.period) return;
  send(kRunningCode, "");
}

void Presence::say_finished(const std::string& message) {
  for (int i = 0; i < kLastWords; ++i) send(kFinishedCode, message);
}

void Presence::say_failed(const std::string& message) {
  for (int i = 0; i < kLastWords; ++i) send(kFailedCode, message);
}

PeerPhase Presence::peer() const {
  if (peer_ == PeerPhase::kRunning && clock_.monotonic() - last_heard_ > options_.lost_after) return PeerPhase::kLost;
  return peer_;
}

void Presence::send(std::int8_t phase, const std::string& message) {
  heartbeat_t heartbeat;
  heartbeat.utime = clock_.utime();
  heartbeat.boot_id = boot_id_;
  heartbeat.role = static_cast<std::int8_t>(role_);
  heartbeat.phase = phase;
  heartbeat.version = version_;
  heartbeat.message = message;
  publish_message(bus_, channel::kHeartbeat, heartbeat);
  last_sent_ = clock_.monotonic();
  sent_ = true;
}

void Presence::on_heartbeat(const heartbeat_t& heartbeat) {
  if (heartbeat.role == static_cast<std::int8_t>(role_)) return;  // our own, or one of our kind
  last_heard_ = clock_.monotonic();
  if (heartbeat.phase == kRunningCode) {
    peer_ = PeerPhase::kRunning;
  } else if (heartbeat.phase == kFinishedCode || heartbeat.phase == kFailedCode) {
    peer_ = heartbeat.phase == kFinishedCode ? PeerPhase::kFinished : PeerPhase::kFailed;
    peer_message_ = heartbeat.message;
  }
}

}  // namespace vantage
