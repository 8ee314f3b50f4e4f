#include "lcmtypes/link/presence.h"

#include <algorithm>
#include <utility>

#include "lcmtypes/link/digest.h"

namespace vantage {
namespace {

constexpr std::int8_t kRunningCode = 0, kFinishedCode = 1, kFailedCode = 2;
constexpr int kLastWords = 3;

std::string speaks(const std::string& version, std::int32_t link_version) {
  return "version " + version + " (link " + std::to_string(link_version) + ")";
}

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
  const bool alive = peer_ == PeerPhase::kRunning || peer_ == PeerPhase::kUnfit;
  if (alive && clock_.monotonic() - last_heard_ > options_.lost_after) return PeerPhase::kLost;
  return peer_;
}

std::optional<std::int64_t> Presence::peer_utime() const {
  if (peer_boot_id_ == 0) return std::nullopt;
  return peer_sent_ + std::chrono::duration_cast<std::chrono::microseconds>(clock_.monotonic() - last_heard_).count();
}

void Presence::send(std::int8_t phase, const std::string& message) {
  heartbeat_t heartbeat;
  heartbeat.utime = clock_.utime();
  heartbeat.boot_id = boot_id_;
  heartbeat.link_version = options_.link_version;
  heartbeat.role = static_cast<std::int8_t>(role_);
  heartbeat.phase = phase;
  heartbeat.heard_boot_id = peer_boot_id_;
  heartbeat.heard_sent = peer_sent_;
  heartbeat.heard_at = peer_heard_at_;
  heartbeat.command_counter = command_counter_;
  heartbeat.version = version_;
  heartbeat.message = message;
  publish_message(bus_, channel::kHeartbeat, heartbeat);
  last_sent_ = clock_.monotonic();
  sent_ = true;
}

void Presence::on_heartbeat(const heartbeat_t& heartbeat) {
  if (heartbeat.role == static_cast<std::int8_t>(role_)) return;  // our own, or one of our kind
  const std::int64_t now = clock_.utime();
  if (heartbeat.boot_id != peer_boot_id_) {
    if (peer_boot_id_ != 0) ++peer_restarts_;
    peer_boot_id_ = heartbeat.boot_id;
    peer_command_counter_ = 0;
    clock_offset_ = {};
  }
  last_heard_ = clock_.monotonic();
  peer_sent_ = heartbeat.utime;
  peer_heard_at_ = now;
  peer_version_ = heartbeat.version;
  peer_command_counter_ = std::max(peer_command_counter_, heartbeat.command_counter);
  if (heartbeat.heard_boot_id == boot_id_) {
    clock_offset_.add(heartbeat.heard_sent, heartbeat.heard_at, heartbeat.utime, now);
  }
  if (heartbeat.link_version != options_.link_version) {
    peer_ = PeerPhase::kUnfit;
    peer_message_ = std::string(role_ == Role::kPlanner ? "the robot" : "the planner") + " is " +
                    speaks(heartbeat.version, heartbeat.link_version) + ", this program " +
                    speaks(version_, options_.link_version) + ": install the same release on both computers";
  } else if (heartbeat.phase == kRunningCode) {
    peer_ = PeerPhase::kRunning;
  } else if (heartbeat.phase == kFinishedCode || heartbeat.phase == kFailedCode) {
    peer_ = heartbeat.phase == kFinishedCode ? PeerPhase::kFinished : PeerPhase::kFailed;
    peer_message_ = heartbeat.message;
  }
}

}  // namespace vantage
