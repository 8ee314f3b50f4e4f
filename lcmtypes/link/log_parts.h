#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <vector>

#include "lcmtypes/link/event_frame.h"

namespace vantage {

/// The name of a log's part: log.lcm, log.1.lcm, log.2.lcm, …
std::filesystem::path log_part(const std::filesystem::path& log, std::size_t part);

/// How many parts of the log are there, counted from the first up to the first that is missing.
std::size_t count_log_parts(const std::filesystem::path& log);

/// Removes all parts but the first, the last of them first, so that what is left at any time is a log's beginning.
/// \throws InputError when one can't be removed.
void remove_later_parts(const std::filesystem::path& log);

/// One file of a log, from event to event. It trusts nothing in it.
class LogPartFile {
 public:
  /// \throws InputError when there is no such file.
  explicit LogPartFile(const std::filesystem::path& path);

  std::uint64_t size() const { return size_; }
  /// Where the next event begins, or should.
  std::uint64_t offset() const { return offset_; }
  bool at_end() const { return offset_ == size_; }

  /// The header at `offset`; nothing, with the reason in `fault`, when there is no whole event. \pre !at_end()
  std::optional<EventHeader> header(std::string* fault);
  /// Reads the event's channel and data, and goes on behind it. False when the file can't be read.
  bool read_body(const EventHeader& header, std::string* channel, std::vector<std::uint8_t>* data);
  void pass(const EventHeader& header) { offset_ += header.event_bytes(); }

  /// True when what is left begins as an event does; a file whose first bytes do not is no log.
  bool begins_event_here();
  /// The first place behind `offset` where a whole event begins and another, or the end, follows it; `size()` when
  /// there is none: then what is left is an event that was being written when the writer died.
  std::uint64_t find_event();
  void go_to(std::uint64_t offset) { offset_ = offset; }

 private:
  std::size_t read_at(std::uint64_t offset, std::span<std::uint8_t> bytes);
  bool whole_event_at(std::uint64_t offset);

  std::ifstream in_;
  std::uint64_t in_at_ = 0;  // where in_ stands: seeking throws its buffer away
  std::uint64_t offset_ = 0;
  std::uint64_t size_ = 0;
};

}  // namespace vantage
