#pragma once

#include <filesystem>

#include "lcmtypes/link/depth_codec.h"
#include "lcmtypes/link/digest.h"
#include "lcmtypes/link/event_log.h"
#include "lcmtypes/link/message_bus.h"
#include "lcmtypes/link/pose_fields.h"
#include "offboard/session/session_config.h"
#include "tests/lcmtypes/sample_depth_map.h"

namespace vantage {

inline constexpr std::int64_t kSampleStart = 1'700'000'000'000'000;  // us
inline constexpr std::int64_t kSampleSession = 4'611'686'018'427'387'905;

/// The n-th depth map of a sample log, from 1: taken 0.5 s after the one before.
inline DepthMap sample_map(int n, int width = 64, int height = 48) {
  DepthMap map = sample_depth_map(width, height, static_cast<unsigned>(n));
  map.utime = kSampleStart + 500'000 * n;
  map.session = static_cast<std::uint64_t>(kSampleSession);
  map.map_id = n;
  map.T_world_camera.translation().x() = 0.01 * n;
  return map;
}

/// Writes events of a session to a log, each at the time it is given.
class SampleLog {
 public:
  explicit SampleLog(const std::filesystem::path& path, LogWriterOptions options = {})
      : log_(path, std::move(options)) {}

  template <typename Message>
  void write(std::int64_t utime, const char* channel, const Message& message) {
    log_.write(utime, channel, encode_message(message));
  }
  void config(std::int64_t utime, const SessionConfig& config = {}) {
    session_config_t message;
    message.utime = utime;
    message.yaml = to_yaml(config);
    write(utime, channel::kSessionConfig, message);
  }
  void state(std::int64_t utime, const Eigen::Isometry3d& pose) {
    robot_state_t message{};
    message.utime = utime;
    message.session = kSampleSession;
    set_pose(pose, &message);
    write(utime, channel::kRobotState, message);
  }
  void map(const DepthMap& map) { write(map.utime + 100'000, channel::kDepthMap, pack_depth_map(map)); }
  void raw(std::int64_t utime, const char* channel, std::string_view bytes) {
    log_.write(utime, channel, {reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()});
  }

 private:
  LogWriter log_;
};

/// A session of `maps` depth maps, a robot state every 0.1 s, and a channel of somebody else's.
inline void write_sample_log(const std::filesystem::path& path, int maps, LogWriterOptions options = {}) {
  SampleLog log(path, std::move(options));
  log.config(kSampleStart);
  for (int n = 1; n <= maps; ++n) {
    for (int i = 1; i <= 5; ++i) {
      Eigen::Isometry3d pose = sample_map(n, 4, 3).T_world_camera;
      pose.translation().z() = 0.1 * i;
      log.state(kSampleStart + 500'000 * (n - 1) + 100'000 * i, pose);
    }
    log.raw(sample_map(n, 4, 3).utime, "CAMERA_OF_SOMEBODY", std::string("not ours \0\xff", 11));
    log.map(sample_map(n));
  }
}

/// A depth map's manifest and chunks of `chunk_bytes`.
inline std::pair<depth_map_manifest_t, std::vector<depth_map_chunk_t>> in_chunks(const DepthMap& map,
                                                                                 std::int32_t chunk_bytes = 300) {
  const std::vector<std::uint8_t> bytes = encode_message(pack_depth_map(map));
  depth_map_manifest_t manifest{};
  manifest.session = static_cast<std::int64_t>(map.session);
  manifest.map_id = map.map_id;
  manifest.bytes = static_cast<std::int32_t>(bytes.size());
  manifest.chunk_bytes = chunk_bytes;
  manifest.chunks = (manifest.bytes + chunk_bytes - 1) / chunk_bytes;
  const Digest digest = digest_of(bytes);
  std::copy(digest.begin(), digest.end(), manifest.digest);
  std::vector<depth_map_chunk_t> chunks;
  for (std::int32_t i = 0; i < manifest.chunks; ++i) {
    depth_map_chunk_t chunk{};
    chunk.session = manifest.session;
    chunk.map_id = manifest.map_id;
    chunk.index = i;
    const auto end = std::min<std::ptrdiff_t>((i + 1) * chunk_bytes, manifest.bytes);
    chunk.data.assign(bytes.begin() + i * chunk_bytes, bytes.begin() + end);
    chunk.size = static_cast<std::int32_t>(chunk.data.size());
    chunks.push_back(chunk);
  }
  return {manifest, chunks};
}

}  // namespace vantage
