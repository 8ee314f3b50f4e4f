#include "lcmtypes/link/event_log.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <system_error>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include "calib/files/input_error.h"

namespace vantage {
namespace {

namespace fs = std::filesystem;

std::string mebibytes(std::uint64_t bytes) { return std::to_string(bytes >> 20) + " MiB"; }

/// Makes a new file's name survive a loss of power. Where the folder can't be opened or synced, it has to do without.
void sync_folder(const fs::path& file) {
  const fs::path folder = file.parent_path();
  const FileDescriptor fd(::open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (fd.valid()) ::fsync(fd.get());
}

}  // namespace

LogWriter::LogWriter(const fs::path& path, LogWriterOptions options) : path_(path), options_(std::move(options)) {
  lock(O_CREAT);
  remove_later_parts(path_);
  open_part(O_TRUNC);
}

LogWriter::LogWriter(const fs::path& path, LogWriterOptions options, Existing)
    : path_(path), options_(std::move(options)) {
  lock(0);
  part_ = count_log_parts(path_) - 1;
  std::optional<std::int64_t> last = find_end(part_, true);
  for (std::size_t part = part_; !last && part > 0;) last = find_end(--part, false);
  if (last) number_ = *last + 1;
  open_part(0);
  if (cut_off_bytes_ > 0 && ::ftruncate(file_->get(), static_cast<off_t>(offset_)) != 0) fail("can't be cut");
}

LogWriter::~LogWriter() = default;

std::unique_ptr<LogWriter> LogWriter::resume(const fs::path& path, LogWriterOptions options) {
  return std::unique_ptr<LogWriter>(new LogWriter(path, std::move(options), Existing{}));
}

void LogWriter::fail(const std::string& doing) const {
  throw InputError(log_part(path_, part_).string() + ": " + doing + ": " + std::strerror(errno));
}

void LogWriter::lock(int flags) {
  lock_ = FileDescriptor(::open(path_.c_str(), O_RDWR | O_CLOEXEC | flags, 0644));
  if (!lock_.valid()) fail("can't be written");
  // Other errors: a file system without locks.
  if (::flock(lock_.get(), LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) {
    throw InputError(path_.string() + ": another program is writing this log; end it, or write another");
  }
}

void LogWriter::open_part(int flags) {
  const fs::path path = log_part(path_, part_);
  auto file = std::make_shared<FileDescriptor>(::open(path.c_str(), O_WRONLY | O_CLOEXEC | flags, 0644));
  if (!file->valid()) fail("can't be written");
  file_ = std::move(file);
  if (flags != 0) sync_folder(path);
}

std::optional<std::int64_t> LogWriter::find_end(std::size_t part, bool may_be_torn) {
  const fs::path path = log_part(path_, part);
  LogPartFile file(path);
  std::optional<std::int64_t> last;
  std::string fault;
  while (!file.at_end()) {
    const std::optional<EventHeader> header = file.header(&fault);
    if (!header) break;
    last = header->number;
    file.pass(*header);
  }
  if (!file.at_end()) {
    const bool no_log = part == 0 && file.offset() == 0 && !file.begins_event_here();
    if (no_log || !may_be_torn || file.find_event() < file.size()) {
      throw InputError(path.string() + ": at byte " + std::to_string(file.offset()) + ": " + fault +
                       (no_log ? "" : "; `vantage-log cut` makes a log of what is whole"));
    }
  }
  if (part == part_) {
    offset_ = file.offset();
    cut_off_bytes_ = file.size() - file.offset();
  }
  return last;
}

void LogWriter::check_disk(std::uint64_t event_bytes) const {
  std::uint64_t free = 0;
  if (options_.free_bytes) {
    free = options_.free_bytes();
  } else {
    struct statvfs disk {};
    if (::fstatvfs(file_->get(), &disk) != 0) fail("its disk can't be asked for free space");
    free = std::uint64_t{disk.f_bavail} * disk.f_frsize;
  }
  if (free < event_bytes || free - event_bytes < options_.keep_free_bytes) {
    throw InputError(log_part(path_, part_).string() + ": its disk has " + mebibytes(free) + " free, and " +
                     mebibytes(options_.keep_free_bytes) + " are kept free: make room, or write to another disk");
  }
}

void LogWriter::write(std::int64_t utime, std::string_view channel, std::span<const std::uint8_t> bytes) {
  if (channel.empty() || channel.size() > EventHeader::kMostChannelBytes || bytes.size() > INT32_MAX) {
    throw std::invalid_argument("LogWriter: a channel of 1 to 63 bytes and at most 2 GiB are needed");
  }
  if (sync_.error() != 0) {
    errno = sync_.error();
    fail("the disk lost what was written");
  }
  const EventHeader header{number_, utime, static_cast<std::uint32_t>(channel.size()),
                           static_cast<std::uint32_t>(bytes.size())};
  buffer_.resize(header.event_bytes());
  put_event_header(header, std::span<std::uint8_t, EventHeader::kBytes>(buffer_.data(), EventHeader::kBytes));
  std::copy(bytes.begin(), bytes.end(),
            std::copy(channel.begin(), channel.end(), buffer_.begin() + EventHeader::kBytes));
  check_disk(buffer_.size());
  if (offset_ > 0 && offset_ >= options_.part_bytes) {
    ++part_;
    offset_ = 0;
    try {
      open_part(O_CREAT | O_EXCL);
    } catch (const InputError&) {
      --part_;
      offset_ = options_.part_bytes;
      throw;
    }
  }
  for (std::size_t done = 0; done < buffer_.size();) {
    const ssize_t count =
        ::pwrite(file_->get(), buffer_.data() + done, buffer_.size() - done, static_cast<off_t>(offset_ + done));
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) {
      const int cause = count < 0 ? errno : ENOSPC;
      [[maybe_unused]] const int cut =
          ::ftruncate(file_->get(), static_cast<off_t>(offset_));  // shrinking needs no room
      errno = cause;
      fail("writing failed");
    }
    done += static_cast<std::size_t>(count);
  }
  offset_ += buffer_.size();
  ++number_;
  sync_.changed(file_);
}

LogReader::LogReader(const fs::path& path, LogReaderOptions options) : path_(path), options_(options), file_(path) {
  if (file_.size() == 0 && !options_.accept_torn_end) {
    throw InputError(path.string() + ": is empty; an LCM log was expected");
  }
}

void LogReader::fail(const std::string& fault) const {
  throw InputError(log_part(path_, part_).string() + ": at byte " + std::to_string(file_.offset()) + ": " + fault);
}

bool LogReader::open_next_part() {
  const fs::path next = log_part(path_, part_ + 1);
  std::error_code ignored;
  if (!fs::exists(next, ignored)) return false;
  file_ = LogPartFile(next);
  ++part_;
  last_of_part_before_ = last_number_;
  return true;
}

bool LogReader::next(LogEvent* event) {
  while (file_.at_end()) {
    if (torn_bytes_ > 0 || !open_next_part()) return false;
  }
  std::string fault;
  const std::optional<EventHeader> header = file_.header(&fault);
  if (!header) {
    std::error_code ignored;
    const bool no_log = part_ == 0 && file_.offset() == 0 && !file_.begins_event_here();
    if (!options_.accept_torn_end || no_log || fs::exists(log_part(path_, part_ + 1), ignored) ||
        file_.find_event() < file_.size()) {
      fail(fault);
    }
    torn_bytes_ = file_.size() - file_.offset();
    file_.go_to(file_.size());
    return false;
  }
  if (last_of_part_before_ && header->number <= *last_of_part_before_) {
    const std::int64_t before = *std::exchange(last_of_part_before_, std::nullopt);
    fail("event " + std::to_string(header->number) + " does not go on where the part before ends (event " +
         std::to_string(before) + "): it belongs to another log; rename it");
  }
  last_of_part_before_.reset();
  event->number = header->number;
  event->utime = header->utime;
  event->part = part_;
  event->offset = file_.offset();
  if (!file_.read_body(*header, &event->channel, &event->bytes)) fail("the log can't be read to the end of its event");
  last_number_ = event->number;
  return true;
}

std::uint64_t LogReader::skip_damage() {
  const std::uint64_t from = file_.offset();
  std::string fault;
  if (!file_.at_end() && !file_.header(&fault)) file_.go_to(file_.find_event());
  return file_.offset() - from;
}

}  // namespace vantage
