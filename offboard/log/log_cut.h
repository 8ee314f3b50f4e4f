#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

namespace vantage {

/// A time on a log: seconds or HH:MM:SS from its first event, or, from 10^8 on, seconds since 1970.
struct LogTime {
  std::int64_t us = 0;
  bool since_1970 = false;
};

/// Reads "12.5", "01:02:03.5" or "1700000000.25". Nothing when it is neither.
std::optional<LogTime> parse_log_time(const std::string& text);

struct CutOptions {
  std::optional<LogTime> from;  ///< events of this time and later
  std::optional<LogTime> to;    ///< events before this time
  std::string channels;         ///< an extended regular expression that fits the whole name; empty: all
};

struct CutResult {
  std::int64_t kept = 0, events = 0;
  std::uint64_t torn_bytes = 0;
  std::int64_t damaged_places = 0;
};

/// Copies a part of a log, whole or not at all. The last configuration of the session before the part, and those
/// within, are always kept, so that it can be replayed. What is damaged or torn stays out. \throws InputError when `in`
/// is no log, nothing is kept, the pattern is none, `out` can't be written.
CutResult cut_log(const std::filesystem::path& in, const std::filesystem::path& out, const CutOptions& options);

}  // namespace vantage
