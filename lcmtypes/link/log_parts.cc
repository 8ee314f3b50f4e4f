#include "lcmtypes/link/log_parts.h"

#include <algorithm>
#include <array>
#include <system_error>

#include "calib/files/input_error.h"

namespace vantage {

namespace fs = std::filesystem;

fs::path log_part(const fs::path& log, std::size_t part) {
  if (part == 0) return log;
  return log.parent_path() / (log.stem().string() + "." + std::to_string(part) + log.extension().string());
}

std::size_t count_log_parts(const fs::path& log) {
  std::size_t parts = 0;
  std::error_code ignored;
  while (fs::exists(log_part(log, parts), ignored)) ++parts;
  return parts;
}

void remove_later_parts(const fs::path& log) {
  std::size_t parts = 1;
  std::error_code error;
  while (fs::exists(log_part(log, parts), error)) ++parts;
  while (--parts > 0) {
    const fs::path part = log_part(log, parts);
    if (!fs::remove(part, error)) throw InputError(part.string() + ": can't be removed: " + error.message());
  }
}

LogPartFile::LogPartFile(const fs::path& path) : in_(path, std::ios::binary) {
  std::error_code error;
  size_ = fs::file_size(path, error);
  if (!in_ || error) throw InputError(path.string() + ": no such file, or it can't be read");
}

std::size_t LogPartFile::read_at(std::uint64_t offset, std::span<std::uint8_t> bytes) {
  if (!in_ || in_at_ != offset) {
    in_.clear();
    in_.seekg(static_cast<std::streamoff>(offset));
  }
  in_.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  const auto count = static_cast<std::size_t>(in_.gcount());
  in_at_ = offset + count;
  return count;
}

std::optional<EventHeader> LogPartFile::header(std::string* fault) {
  std::array<std::uint8_t, EventHeader::kBytes> bytes{};
  const std::size_t count = read_at(offset_, bytes);
  if (!begins_event(std::span(bytes).first(count))) {
    *fault = offset_ == 0 ? "not an LCM log" : "the log is damaged (no event begins here)";
    return std::nullopt;
  }
  if (count < bytes.size()) {
    *fault = "the log ends within an event";
    return std::nullopt;
  }
  const std::optional<EventHeader> header = get_event_header(bytes);
  if (!header) {
    *fault = "the log is damaged (an event with impossible lengths)";
    return std::nullopt;
  }
  if (header->event_bytes() > size_ - offset_) {
    *fault = "the log ends within an event";
    return std::nullopt;
  }
  return header;
}

bool LogPartFile::read_body(const EventHeader& header, std::string* channel, std::vector<std::uint8_t>* data) {
  channel->resize(header.channel_bytes);
  data->resize(header.data_bytes);
  const std::uint64_t begin = offset_ + EventHeader::kBytes;
  const std::span channel_bytes(reinterpret_cast<std::uint8_t*>(channel->data()), channel->size());
  if (read_at(begin, channel_bytes) < channel->size()) return false;
  if (read_at(begin + channel->size(), *data) < data->size()) return false;
  pass(header);
  return true;
}

bool LogPartFile::begins_event_here() {
  std::array<std::uint8_t, EventHeader::kSync.size()> bytes{};
  return begins_event(std::span(bytes).first(read_at(offset_, bytes)));
}

bool LogPartFile::whole_event_at(std::uint64_t offset) {
  std::array<std::uint8_t, EventHeader::kBytes> bytes{};
  if (read_at(offset, bytes) < bytes.size()) return false;
  const std::optional<EventHeader> header = get_event_header(bytes);
  if (!header || header->event_bytes() > size_ - offset) return false;
  const std::size_t count = read_at(offset + header->event_bytes(), std::span(bytes).first(EventHeader::kSync.size()));
  return begins_event(std::span(bytes).first(count));
}

std::uint64_t LogPartFile::find_event() {
  constexpr std::size_t kBlock = std::size_t{1} << 20;
  std::vector<std::uint8_t> block(kBlock + EventHeader::kSync.size() - 1);  // overlaps the next
  for (std::uint64_t begin = offset_ + 1; begin < size_; begin += kBlock) {
    const auto end = block.begin() + static_cast<std::ptrdiff_t>(read_at(begin, block));
    for (auto at = block.begin();; ++at) {
      at = std::search(at, end, EventHeader::kSync.begin(), EventHeader::kSync.end());
      if (at == end) break;
      const std::uint64_t offset = begin + static_cast<std::uint64_t>(at - block.begin());
      if (whole_event_at(offset)) return offset;
    }
  }
  return size_;
}

}  // namespace vantage
