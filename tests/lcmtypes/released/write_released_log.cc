// Writes one or more events of every message type on its channel, as the programs of this version write them: the
// file of a release.  write_released_log FILE

#include <algorithm>
#include <cstdio>

#include "calib/program.h"
#include "lcmtypes/link/depth_codec.h"
#include "lcmtypes/link/digest.h"
#include "lcmtypes/link/event_log.h"
#include "lcmtypes/link/message_bus.h"
#include "lcmtypes/link/pose_fields.h"
#include "offboard/session/session_config.h"
#include "tests/lcmtypes/sample_depth_map.h"

namespace vantage {
namespace {

constexpr std::int64_t kStart_us = 1'700'000'000'000'000;
constexpr std::int64_t kStep_us = 100'000;
constexpr std::int64_t kRobot = 42, kPlanner = 4'611'686'018'427'387'905;  // the latter needs all of its 63 bits

/// Writes each message 0.1 s after the one before.
class SampleLog {
 public:
  explicit SampleLog(const char* path) : log_(path) {}

  template <typename Message>
  void write(const char* channel, Message message) {
    if constexpr (!std::is_same_v<Message, depth_map_t>) message.utime = now_;  // a map's is its capture time
    log_.write(now_, channel, encode_message(message));
    now_ += kStep_us;
  }

 private:
  LogWriter log_;
  std::int64_t now_ = kStart_us;
};

DepthMap sample(unsigned seed) {
  DepthMap map = sample_depth_map(32, 24, seed);
  map.session = kRobot;
  return map;
}

void write_in_chunks(const depth_map_t& map, SampleLog* log) {
  constexpr std::int32_t kChunkBytes = 1136;  // as depth_map_sender.h has it
  const std::vector<std::uint8_t> bytes = encode_message(map);
  depth_map_manifest_t manifest{};
  manifest.session = map.session;
  manifest.map_id = map.map_id;
  manifest.bytes = static_cast<std::int32_t>(bytes.size());
  manifest.chunk_bytes = kChunkBytes;
  manifest.chunks = (manifest.bytes + kChunkBytes - 1) / kChunkBytes;
  const Digest digest = digest_of(bytes);
  std::copy(digest.begin(), digest.end(), manifest.digest);
  log->write(channel::kDepthManifest, manifest);
  depth_map_receipt_t receipt{};
  receipt.session = map.session;
  receipt.map_id = map.map_id;
  std::copy(digest.begin(), digest.end(), receipt.digest);
  for (std::int32_t i = 0; i < manifest.chunks; ++i) {
    depth_map_chunk_t chunk{};
    chunk.session = map.session;
    chunk.map_id = map.map_id;
    chunk.index = i;
    const std::int32_t begin = i * kChunkBytes, end = std::min(begin + kChunkBytes, manifest.bytes);
    chunk.size = end - begin;
    chunk.data.assign(bytes.begin() + begin, bytes.begin() + end);
    log->write(channel::kDepthChunk, chunk);
    if (i > 0) continue;
    receipt.first = {1};
    receipt.last = {manifest.chunks - 1};
    receipt.ranges = 1;
    log->write(channel::kDepthReceipt, receipt);
  }
  receipt.complete = 1;
  receipt.ranges = 0;
  receipt.first.clear();
  receipt.last.clear();
  log->write(channel::kDepthReceipt, receipt);
}

void write_log(const char* path) {
  SampleLog log(path);
  session_config_t config;
  config.yaml = to_yaml(SessionConfig{});
  log.write(channel::kSessionConfig, config);
  heartbeat_t heartbeat{};
  heartbeat.version = VANTAGE_VERSION;
  heartbeat.boot_id = kRobot;
  log.write(channel::kHeartbeat, heartbeat);
  heartbeat.boot_id = kPlanner;
  heartbeat.role = 1;
  log.write(channel::kHeartbeat, heartbeat);
  robot_state_t state{};
  state.session = kRobot;
  set_pose(sample(1).T_world_camera, &state);
  log.write(channel::kRobotState, state);
  motion_goal_t goal{};
  goal.planner = kPlanner;
  goal.goal_id = 7;
  goal.view_id = 3;
  set_pose(sample(1).T_world_camera, &goal);
  log.write(channel::kMotionGoal, goal);
  key_pose_t key_pose{};
  key_pose.session = kRobot;
  key_pose.map_id = 1;
  set_pose(sample(1).T_world_camera, &key_pose);
  log.write(channel::kKeyPose, key_pose);
  command_t command{};
  command.sender = kPlanner;
  command.robot = kRobot;
  command.counter = 1;
  command.expires = kStart_us + 60'000'000;
  command.payload = encode_message(goal);
  command.size = static_cast<std::int32_t>(command.payload.size());
  log.write(channel::kCommand, command);
  status_t status{};
  status.boot_id = kRobot;
  status.name = {"depth_maps.acknowledged", "frames"};
  status.value = {1, 250};
  status.counters = 2;
  log.write(channel::kStatus, status);
  preview_t preview{};
  preview.session = kRobot;
  preview.width = 1;
  preview.height = 1;
  preview.jpeg = {0xFF, 0xD8, 0xFF, 0xD9};  // begin and end of an image: readers of logs do not look into it
  preview.size = static_cast<std::int32_t>(preview.jpeg.size());
  log.write(channel::kPreview, preview);
  state.planner = kPlanner;
  state.goal_id = 7;
  state.activity = 1;
  log.write(channel::kRobotState, state);
  log.write(channel::kDepthMap, pack_depth_map(sample(1)));
  write_in_chunks(pack_depth_map(sample(2)), &log);
  heartbeat.phase = 1;
  heartbeat.message = "every candidate has been visited";
  log.write(channel::kHeartbeat, heartbeat);
}

}  // namespace
}  // namespace vantage

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: write_released_log FILE\n");
    return 2;
  }
  return vantage::run_program("write_released_log", [&] {
    vantage::write_log(argv[1]);
    return 0;
  });
}
