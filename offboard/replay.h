#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <optional>

#include "offboard/session/session.h"
#include "offboard/session/session_config.h"

namespace vantage {

/// What a look through a log found.
struct LogContents {
  std::optional<SessionConfig> config;  ///< with paths relative to the log's folder made whole
  std::int64_t depth_maps = 0;          ///< whole ones; maps in chunks are put together during the replay
  std::int64_t events = 0;
};

/// Reads a log from end to end and decodes every message of ours.
/// \throws InputError "LOG: event N: …" for the first thing that does not hold: damage, a message that does not decode,
/// a depth map that is not valid, a configuration that is not.
LogContents examine_log(const std::filesystem::path& log);

/// Feeds a log's depth maps to a session, through the same door as if they came from a robot. `speed`: 1 as recorded, 2
/// twice as fast, 0 without waiting. Ends with the log, when the session has finished, or when `stop` becomes true.
/// \throws InputError as examine_log; also when the session refuses a depth map.
void replay_log(const std::filesystem::path& log, double speed, const std::atomic<bool>& stop, Session& session);

}  // namespace vantage
