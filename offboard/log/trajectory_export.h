#pragma once

#include <cstdint>
#include <filesystem>

namespace vantage {

/// What says where the camera was.
enum class PoseSource {
  kDepthMaps,   ///< of key frames, at their capture times: what the map is made from
  kRobotStates  ///< what the robot reports, ten times a second, at its sending times
};

struct TrajectoryExport {
  std::int64_t poses = 0;
  std::int64_t left_out = 0;  ///< of a time that another one has, or not rigid
};

/// Writes T_world_camera over time as a TUM trajectory, sorted by time.
/// \throws InputError when the log is none or damaged or holds no such pose, or the file can't be written.
TrajectoryExport export_trajectory(const std::filesystem::path& log, PoseSource source,
                                   const std::filesystem::path& file);

}  // namespace vantage
