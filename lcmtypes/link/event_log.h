#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "calib/files/file_descriptor.h"
#include "lcmtypes/link/file_sync.h"
#include "lcmtypes/link/log_parts.h"

namespace vantage {

/// One message of a log.
struct LogEvent {
  std::int64_t number = 0;
  std::int64_t utime = 0;  ///< when it was received, us
  std::string channel;
  std::vector<std::uint8_t> bytes;
  std::size_t part = 0;      ///< of the log that holds it
  std::uint64_t offset = 0;  ///< of its first byte in that part
};

struct LogWriterOptions {
  std::uint64_t part_bytes = std::uint64_t{1} << 30;         ///< a part that grew to this is closed, the next begun
  std::uint64_t keep_free_bytes = std::uint64_t{256} << 20;  ///< of the disk; an event that would leave less is refused
  std::function<std::uint64_t()> free_bytes = {};            ///< of the disk; empty: as the kernel says
};

/// Writes an LCM log as it comes, in parts log.lcm, log.1.lcm, log.2.lcm, …: each is a log that lcm-logplayer reads,
/// and LogReader reads all in order.
///
/// Each event is in the kernel when `write` returns: the program may be killed and loses none. It is on the disk a
/// second later, so that a loss of power costs the last second. One program at a time writes a log.
class LogWriter {
 public:
  /// Begins a new log; an old one of that name goes, with all its parts.
  /// \throws InputError when the file can't be made, or another program is writing it.
  explicit LogWriter(const std::filesystem::path& path, LogWriterOptions options = {});
  /// Goes on with a log behind its last whole event. What follows that (`cut_off_bytes`) was being written when the
  /// writer died, and is cut off.
  /// \throws InputError as above; when there is no such log; when it is damaged and whole events follow the damage.
  static std::unique_ptr<LogWriter> resume(const std::filesystem::path& path, LogWriterOptions options = {});
  ~LogWriter();
  LogWriter(const LogWriter&) = delete;
  LogWriter& operator=(const LogWriter&) = delete;

  /// \throws InputError when the disk is too full, or fails. What was written before stays, nothing of this event does:
  /// there may be another try. std::invalid_argument for a channel that LCM does not take (1 to 63 bytes).
  void write(std::int64_t utime, std::string_view channel, std::span<const std::uint8_t> bytes);

  std::uint64_t cut_off_bytes() const { return cut_off_bytes_; }

 private:
  struct Existing {};
  LogWriter(const std::filesystem::path& path, LogWriterOptions options, Existing);
  void lock(int flags);
  void open_part(int flags);
  /// The number of the part's last event; goes behind its last whole one.
  std::optional<std::int64_t> find_end(std::size_t part, bool may_be_torn);
  void check_disk(std::uint64_t event_bytes) const;
  [[noreturn]] void fail(const std::string& doing) const;

  std::filesystem::path path_;
  LogWriterOptions options_;
  FileDescriptor lock_;  // of the first part
  std::size_t part_ = 0;
  std::shared_ptr<FileDescriptor> file_;  // of the current part; none until an event needs the next
  std::uint64_t offset_ = 0;              // in the current part
  std::int64_t number_ = 0;               // of the next event
  std::uint64_t cut_off_bytes_ = 0;
  std::vector<std::uint8_t> buffer_;
  FileSync sync_;
};

struct LogReaderOptions {
  bool accept_torn_end = false;  ///< the last part may be empty, or end within an event, as a killed writer leaves it
};

/// Reads an LCM log, all its parts in order, and trusts nothing in it.
class LogReader {
 public:
  /// \throws InputError when there is no such file, or it is empty.
  explicit LogReader(const std::filesystem::path& path, LogReaderOptions options = {});

  /// False at the end. \throws InputError "FILE: at byte N: …" where the log is damaged, ends within an event (unless
  /// that is accepted), or goes on in a part that belongs to another log.
  bool next(LogEvent* event);
  /// After `next` has thrown: goes to the next whole event, or to the end. The bytes that are passed over.
  std::uint64_t skip_damage();

  const std::filesystem::path& path() const { return path_; }
  /// The part that is being read.
  std::size_t part() const { return part_; }
  std::uint64_t offset() const { return file_.offset(); }
  bool at_end_of_part() const { return file_.at_end(); }
  /// After `next` gave false: bytes at the log's end that are no whole event.
  std::uint64_t torn_bytes() const { return torn_bytes_; }

 private:
  [[noreturn]] void fail(const std::string& fault) const;
  bool open_next_part();

  std::filesystem::path path_;
  LogReaderOptions options_;
  std::size_t part_ = 0;
  LogPartFile file_;
  std::optional<std::int64_t> last_number_, last_of_part_before_;
  std::uint64_t torn_bytes_ = 0;
};

}  // namespace vantage
