#pragma once

#include <cstdint>
#include <exception>
#include <span>
#include <vector>

#include "lcmtypes/link/wire_layout.h"

namespace vantage {

/// What came through the door, and what was turned away.
struct DecodeCounters {
  std::uint64_t accepted = 0;
  std::uint64_t wrong_type = 0;  ///< another fingerprint: a foreign type, or another version of ours
  std::uint64_t wrong_size = 0;  ///< shorter or longer than its own lengths say
  std::uint64_t malformed = 0;   ///< the generated decoder refused it

  std::uint64_t refused() const { return wrong_type + wrong_size + malformed; }
};

template <typename Message>
std::vector<std::uint8_t> encode_message(const Message& message) {
  const int size = message.getEncodedSize();
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(size));
  message.encode(bytes.data(), 0, size);
  return bytes;
}

/// The one door for bytes that come from elsewhere: type and length are checked before the generated decoder sees them,
/// it must use every byte, and it may throw. False, with the reason counted, when the bytes are refused.
template <typename Message>
bool decode_message(std::span<const std::uint8_t> bytes, Message* message, DecodeCounters* counters) {
  static_assert(!kWireLayout<Message>.empty(), "give this message type its layout in wire_layout.h");
  std::uint64_t fingerprint = 0;
  for (std::size_t i = 0; i < 8 && i < bytes.size(); ++i) fingerprint = fingerprint << 8 | bytes[i];
  if (bytes.size() < 8 || fingerprint != static_cast<std::uint64_t>(Message::getHash())) {
    ++counters->wrong_type;
    return false;
  }
  if (bytes.size() > INT32_MAX || !layout_fits(kWireLayout<Message>, bytes)) {
    ++counters->wrong_size;
    return false;
  }
  try {
    const int size = static_cast<int>(bytes.size());
    if (message->decode(bytes.data(), 0, size) == size) {
      ++counters->accepted;
      return true;
    }
  } catch (const std::exception&) {  // std::length_error, std::bad_alloc
  }
  ++counters->malformed;
  return false;
}

}  // namespace vantage
