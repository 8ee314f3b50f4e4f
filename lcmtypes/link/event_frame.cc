#include "lcmtypes/link/event_frame.h"

#include <algorithm>

namespace vantage {
namespace {

template <typename Integer>
void put(Integer value, std::uint8_t* out) {
  for (std::size_t i = 0; i < sizeof value; ++i) {
    out[i] = static_cast<std::uint8_t>(static_cast<std::uint64_t>(value) >> 8 * (sizeof value - 1 - i));
  }
}

template <typename Integer>
Integer get(const std::uint8_t* bytes) {
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < sizeof(Integer); ++i) value = value << 8 | bytes[i];
  return static_cast<Integer>(value);
}

}  // namespace

void put_event_header(const EventHeader& header, std::span<std::uint8_t, EventHeader::kBytes> out) {
  std::copy(EventHeader::kSync.begin(), EventHeader::kSync.end(), out.begin());
  put(header.number, out.data() + 4);
  put(header.utime, out.data() + 12);
  put(header.channel_bytes, out.data() + 20);
  put(header.data_bytes, out.data() + 24);
}

std::optional<EventHeader> get_event_header(std::span<const std::uint8_t, EventHeader::kBytes> bytes) {
  if (!begins_event(bytes)) return std::nullopt;
  const EventHeader header{get<std::int64_t>(bytes.data() + 4), get<std::int64_t>(bytes.data() + 12),
                           get<std::uint32_t>(bytes.data() + 20), get<std::uint32_t>(bytes.data() + 24)};
  const bool possible = header.channel_bytes > 0 && header.channel_bytes <= EventHeader::kMostChannelBytes &&
                        header.data_bytes <= INT32_MAX;
  if (!possible) return std::nullopt;
  return header;
}

bool begins_event(std::span<const std::uint8_t> bytes) {
  const std::size_t known = std::min(bytes.size(), EventHeader::kSync.size());
  return std::equal(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(known), EventHeader::kSync.begin());
}

}  // namespace vantage
