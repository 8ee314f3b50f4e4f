#include "lcmtypes/link/event_log.h"

#include <array>
#include <cerrno>
#include <cstring>
#include <system_error>

#include <lcm/eventlog.h>

#include "calib/files/input_error.h"

namespace vantage {
namespace {

constexpr std::uint32_t kSync = 0xEDA1DA01;
constexpr std::size_t kHeaderBytes = 28;         // sync, number, time, channel length, data length
constexpr std::uint32_t kMostChannelBytes = 63;  // LCM_MAX_CHANNEL_NAME_LENGTH

template <std::size_t kBytes>
std::uint64_t big_endian(const char* bytes) {
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < kBytes; ++i) value = value << 8 | static_cast<std::uint8_t>(bytes[i]);
  return value;
}

}  // namespace

struct LogWriter::Impl {
  lcm_eventlog_t* log;
};

LogWriter::LogWriter(const std::filesystem::path& path) : path_(path) {
  errno = 0;
  lcm_eventlog_t* log = ::lcm_eventlog_create(path.c_str(), "w");
  if (log == nullptr) throw InputError(path.string() + ": can't be written: " + std::strerror(errno));
  impl_ = new Impl{log};
}

LogWriter::~LogWriter() {
  ::lcm_eventlog_destroy(impl_->log);
  delete impl_;
}

void LogWriter::write(std::int64_t utime, std::string_view channel, std::span<const std::uint8_t> bytes) {
  std::string name(channel);
  lcm_eventlog_event_t event{};
  event.timestamp = utime;
  event.channellen = static_cast<std::int32_t>(name.size());
  event.datalen = static_cast<std::int32_t>(bytes.size());
  event.channel = name.data();
  event.data = const_cast<std::uint8_t*>(bytes.data());  // LCM's C interface is not const-correct; it only reads
  errno = 0;
  if (::lcm_eventlog_write_event(impl_->log, &event) != 0 || std::fflush(impl_->log->f) != 0) {
    throw InputError(path_.string() + ": writing failed: " + std::strerror(errno));
  }
}

LogReader::LogReader(const std::filesystem::path& path) : path_(path), in_(path, std::ios::binary) {
  std::error_code error;
  size_ = std::filesystem::file_size(path, error);
  if (!in_ || error) throw InputError(path.string() + ": no such file, or it can't be read");
  if (size_ == 0) throw InputError(path.string() + ": is empty; an LCM log was expected");
}

void LogReader::fail(const std::string& fault) const {
  throw InputError(path_.string() + ": at byte " + std::to_string(offset_) + ": " + fault);
}

bool LogReader::next(LogEvent* event) {
  if (offset_ == size_) return false;
  const std::uint64_t rest = size_ - offset_;
  std::array<char, kHeaderBytes> header{};
  if (rest < kHeaderBytes || !in_.read(header.data(), header.size())) fail("the log ends within an event");
  if (big_endian<4>(header.data()) != kSync) {
    fail(offset_ == 0 ? "not an LCM log" : "the log is damaged (no event begins here)");
  }
  const auto channel_bytes = static_cast<std::uint32_t>(big_endian<4>(header.data() + 20));
  const auto data_bytes = static_cast<std::uint32_t>(big_endian<4>(header.data() + 24));
  if (channel_bytes == 0 || channel_bytes > kMostChannelBytes || data_bytes > INT32_MAX) {
    fail("the log is damaged (an event with impossible lengths)");
  }
  if (std::uint64_t{channel_bytes} + data_bytes > rest - kHeaderBytes) fail("the log ends within an event");
  event->number = static_cast<std::int64_t>(big_endian<8>(header.data() + 4));
  event->utime = static_cast<std::int64_t>(big_endian<8>(header.data() + 12));
  event->channel.resize(channel_bytes);
  event->bytes.resize(data_bytes);
  in_.read(event->channel.data(), channel_bytes);
  in_.read(reinterpret_cast<char*>(event->bytes.data()), static_cast<std::streamsize>(data_bytes));
  if (!in_) fail("the log can't be read to the end of its event");
  offset_ += kHeaderBytes + channel_bytes + data_bytes;
  return true;
}

}  // namespace vantage
