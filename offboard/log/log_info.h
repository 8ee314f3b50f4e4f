#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <ostream>
#include <string>

namespace vantage {

struct ChannelInfo {
  std::int64_t events = 0;
  std::uint64_t bytes = 0;                       ///< of messages, without their frames
  std::int64_t first_utime = 0, last_utime = 0;  ///< lowest and highest, us
};

struct LogInfo {
  std::size_t parts = 0;
  std::uint64_t bytes = 0;  ///< of all parts
  std::int64_t events = 0;
  std::int64_t first_utime = 0, last_utime = 0;
  std::int64_t damaged_places = 0;
  std::uint64_t torn_bytes = 0;
  std::map<std::string, ChannelInfo> channels;
  std::string config;  ///< the session's, as one line; empty: the log has none
};

/// \throws InputError when it is no log.
LogInfo read_log_info(const std::filesystem::path& log);

/// For people: a few lines about the log, then a line a channel. Times in the table count from the log's first.
void print_log_info(const std::filesystem::path& log, const LogInfo& info, std::ostream& out);

}  // namespace vantage
