#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

namespace vantage {

/// How LCM's log files frame an event: a header of big-endian numbers (a sync word, the event's number, its time, the
/// lengths of channel and data), the channel, the data.
struct EventHeader {
  static constexpr std::size_t kBytes = 28;
  static constexpr std::array<std::uint8_t, 4> kSync{0xED, 0xA1, 0xDA, 0x01};
  static constexpr std::uint32_t kMostChannelBytes = 63;  ///< LCM_MAX_CHANNEL_NAME_LENGTH

  std::int64_t number = 0;
  std::int64_t utime = 0;
  std::uint32_t channel_bytes = 0;
  std::uint32_t data_bytes = 0;

  /// Of the whole event.
  std::uint64_t event_bytes() const { return kBytes + std::uint64_t{channel_bytes} + data_bytes; }
};

void put_event_header(const EventHeader& header, std::span<std::uint8_t, EventHeader::kBytes> out);

/// Nothing when no event begins here: another sync word, or lengths that no event has.
std::optional<EventHeader> get_event_header(std::span<const std::uint8_t, EventHeader::kBytes> bytes);

/// True when `bytes` are the sync word, or as much of its beginning as there are.
bool begins_event(std::span<const std::uint8_t> bytes);

}  // namespace vantage
