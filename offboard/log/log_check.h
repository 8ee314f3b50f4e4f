#pragma once

#include <cstdint>
#include <filesystem>
#include <ostream>

namespace vantage {

struct LogCheck {
  std::int64_t events = 0;
  std::int64_t unknown = 0;  ///< on channels that are not ours: nothing is said of them
  std::int64_t whole_maps = 0, maps_in_chunks = 0;
  std::int64_t foreign_chunks = 0;
  std::int64_t faults = 0;
};

/// Looks at everything that a log holds: the framing of each event, each message of ours, each depth map unpacked, maps
/// in chunks put together to their digest, the configuration. A line a fault, with its event and byte, goes to `out`.
/// \throws InputError when it is no log.
LogCheck check_log(const std::filesystem::path& log, std::ostream& out);

}  // namespace vantage
