#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>

#include "lcmtypes/link/event_log.h"

namespace vantage {

/// A place where a log does not hold.
struct LogDamage {
  std::string fault;               ///< with file and byte
  std::uint64_t passed_bytes = 0;  ///< up to the next whole event
};

/// The log that an argument means: itself, or a session folder's. \throws InputError when a folder holds none.
std::filesystem::path log_of(const std::filesystem::path& file_or_folder);

/// Reads a log from end to end, past damage. Returns the bytes at its end that are no whole event.
/// \throws InputError when it is no log; whatever `on_event` throws.
std::uint64_t scan_log(const std::filesystem::path& log, const std::function<void(const LogEvent&)>& on_event,
                       const std::function<void(const LogDamage&)>& on_damage);

/// The same where damage is an error. A torn end is not.
std::uint64_t scan_whole_log(const std::filesystem::path& log, const std::function<void(const LogEvent&)>& on_event);

/// "log.lcm: event 7, byte 1234: CHANNEL: "
std::string place_of(const std::filesystem::path& log, const LogEvent& event);

}  // namespace vantage
