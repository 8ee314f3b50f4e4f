#pragma once

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace vantage {

/// One message of a log.
struct LogEvent {
  std::int64_t number = 0;
  std::int64_t utime = 0;  ///< when it was received, us
  std::string channel;
  std::vector<std::uint8_t> bytes;
};

/// Writes an LCM log as it comes: lcm-logplayer and lcm-spy read it, and each event is in the file when `write`
/// returns.
class LogWriter {
 public:
  /// \throws InputError when the file can't be made.
  explicit LogWriter(const std::filesystem::path& path);
  ~LogWriter();
  LogWriter(const LogWriter&) = delete;
  LogWriter& operator=(const LogWriter&) = delete;

  /// \throws InputError when the disk is full.
  void write(std::int64_t utime, std::string_view channel, std::span<const std::uint8_t> bytes);

 private:
  struct Impl;
  std::filesystem::path path_;
  Impl* impl_;
};

/// Reads an LCM log and trusts nothing in it.
class LogReader {
 public:
  /// \throws InputError when there is no such file, or it is no LCM log.
  explicit LogReader(const std::filesystem::path& path);

  /// False at the end. \throws InputError "FILE: at byte N: …" where the file is damaged or ends within an event.
  bool next(LogEvent* event);

  const std::filesystem::path& path() const { return path_; }

 private:
  [[noreturn]] void fail(const std::string& fault) const;

  std::filesystem::path path_;
  std::ifstream in_;
  std::uint64_t offset_ = 0;  // of the event being read
  std::uint64_t size_ = 0;
};

}  // namespace vantage
