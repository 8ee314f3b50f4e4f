#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "lcmtypes/link/message.h"

namespace vantage {

/// Of all channels and the rules on them. Programs with different ones say so and do not work together.
inline constexpr std::int32_t kLinkVersion = 2;

/// Channels; each carries one type, and the number of its schema's version.
namespace channel {
inline constexpr const char* kDepthMap = "VANTAGE_DEPTH_MAP_1";            ///< depth_map_t, in logs
inline constexpr const char* kDepthManifest = "VANTAGE_DEPTH_MANIFEST_2";  ///< depth_map_manifest_t, sealed
inline constexpr const char* kDepthChunk = "VANTAGE_DEPTH_CHUNK_1";        ///< depth_map_chunk_t
inline constexpr const char* kDepthReceipt = "VANTAGE_DEPTH_RECEIPT_2";    ///< depth_map_receipt_t, sealed
inline constexpr const char* kCommand = "VANTAGE_COMMAND_1";               ///< command_t, sealed
inline constexpr const char* kMotionGoal = "VANTAGE_MOTION_GOAL_1";        ///< motion_goal_t, in logs
inline constexpr const char* kRobotState = "VANTAGE_ROBOT_STATE_1";        ///< robot_state_t, sealed
inline constexpr const char* kHeartbeat = "VANTAGE_HEARTBEAT_2";           ///< heartbeat_t, sealed
inline constexpr const char* kStatus = "VANTAGE_STATUS_1";                 ///< status_t, sealed
inline constexpr const char* kKeyPose = "VANTAGE_KEY_POSE_1";              ///< key_pose_t, sealed
inline constexpr const char* kPreview = "VANTAGE_PREVIEW_1";               ///< preview_t
inline constexpr const char* kSessionConfig = "VANTAGE_SESSION_CONFIG_1";  ///< session_config_t, in logs
}  // namespace channel

/// How programs talk: publish to a named channel, hear what others publish on it.
///
/// Delivery is best effort: a message may be lost, doubled or late. Handlers run in the thread that calls `handle`,
/// one at a time. `publish` may be called from any thread.
class MessageBus {
 public:
  using Handler = std::function<void(std::span<const std::uint8_t> bytes)>;

  virtual ~MessageBus() = default;
  virtual void publish(std::string_view channel, std::span<const std::uint8_t> bytes) = 0;
  virtual void subscribe(std::string_view channel, Handler handler) = 0;
  /// Delivers what has come; waits up to `timeout` for the first message. False when there was none.
  virtual bool handle(std::chrono::milliseconds timeout) = 0;
};

template <typename Message>
void publish_message(MessageBus& bus, std::string_view channel, const Message& message) {
  bus.publish(channel, encode_message(message));
}

/// Decodes at the door: `handler` sees only messages that passed it. `counters` must outlive the bus.
template <typename Message, typename Function>
void subscribe_message(MessageBus& bus, std::string_view channel, DecodeCounters* counters, Function handler) {
  bus.subscribe(channel, [counters, handler = std::move(handler)](std::span<const std::uint8_t> bytes) {
    Message message;
    if (decode_message(bytes, &message, counters)) handler(message);
  });
}

}  // namespace vantage
