#include "offboard/replay.h"

#include <chrono>
#include <map>
#include <span>
#include <string>
#include <thread>

#include <vantage/session_config_t.hpp>

#include "calib/files/input_error.h"
#include "lcmtypes/link/depth_codec.h"
#include "lcmtypes/link/depth_map_receiver.h"
#include "lcmtypes/link/event_log.h"
#include "lcmtypes/link/memory_bus.h"
#include "lcmtypes/link/sealed_bus.h"

namespace vantage {
namespace {

[[noreturn]] void fail(const std::filesystem::path& log, const LogEvent& event, const std::string& fault) {
  throw InputError(log.string() + ": event " + std::to_string(event.number) + " (" + event.channel + "): " + fault);
}

template <typename Message>
Message decode_event(const std::filesystem::path& log, const LogEvent& event) {
  Message message;
  DecodeCounters counters;
  if (!decode_message(without_seal(kWireLayout<Message>, event.bytes), &message, &counters)) {
    fail(log, event,
         counters.wrong_type > 0 ? "is of another type or another version than this program's" : "does not decode");
  }
  return message;
}

/// Every message of ours must decode; only depth maps are looked into.
void check_event(const std::filesystem::path& log, const LogEvent& event, LogContents* contents) {
  if (event.channel == channel::kDepthMap) {
    std::string why;
    if (!unpack_depth_map(decode_event<depth_map_t>(log, event), &why)) fail(log, event, why);
    ++contents->depth_maps;
  } else if (event.channel == channel::kSessionConfig) {
    const auto message = decode_event<session_config_t>(log, event);
    contents->config = parse_session_config(message.yaml, log.string() + " (its configuration)", log.parent_path());
  } else if (event.channel == channel::kKeyPose) {
    decode_event<key_pose_t>(log, event);
  } else if (event.channel == channel::kDepthManifest) {
    decode_event<depth_map_manifest_t>(log, event);
  } else if (event.channel == channel::kDepthChunk) {
    decode_event<depth_map_chunk_t>(log, event);
  }
}

/// What a recording of a sealed network holds of the messages that are heard here.
std::span<const std::uint8_t> unsealed(const LogEvent& event) {
  if (event.channel == channel::kDepthManifest) return without_seal(kWireLayout<depth_map_manifest_t>, event.bytes);
  if (event.channel == channel::kKeyPose) return without_seal(kWireLayout<key_pose_t>, event.bytes);
  return event.bytes;
}

}  // namespace

LogContents examine_log(const std::filesystem::path& log) {
  LogContents contents;
  LogReader reader(log);
  for (LogEvent event; reader.next(&event);) {
    check_event(log, event, &contents);
    ++contents.events;
  }
  return contents;
}

void replay_log(const std::filesystem::path& log, double speed, const std::atomic<bool>& stop, Session& session) {
  const SystemClock clock;
  MemoryBus bus;
  LogEvent event;
  DepthMapReceiver receiver(bus, clock, [&](const depth_map_t& map) {
    std::string why;
    if (!session.finished() && !session.take(map, &why)) fail(log, event, why);
  });
  DecodeCounters key_poses;
  subscribe_message<key_pose_t>(bus, channel::kKeyPose, &key_poses,
                                [&](const key_pose_t& pose) { session.correct(pose); });
  LogReader reader(log);
  const std::chrono::nanoseconds start = clock.monotonic();
  std::optional<std::int64_t> first_utime;
  while (!stop && !session.finished() && reader.next(&event)) {
    if (!first_utime) first_utime = event.utime;
    if (speed > 0) {
      const std::chrono::duration<double> due{static_cast<double>(event.utime - *first_utime) * 1e-6 / speed};
      while (!stop && clock.monotonic() - start < due) std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    bus.publish(event.channel, unsealed(event));
    while (bus.handle(std::chrono::milliseconds(0))) {
    }
  }
}

}  // namespace vantage
