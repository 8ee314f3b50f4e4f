#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "lcmtypes/link/link_key.h"
#include "lcmtypes/link/message_bus.h"

namespace vantage {

/// A bus on which nobody without the key can speak: whatever goes out on a sealed channel carries a trailer of 32
/// bytes, HMAC-SHA512-256 (libsodium's crypto_auth) over "vantage-link-2", the channel's name and the message; whatever
/// comes in without a right one is counted and goes no further. The trailer is checked before anything is decoded, and
/// taken off.
///
/// Sealed is all but depth maps' chunks, whose digest the sealed manifest carries, and previews. A seal tells who
/// spoke, not when: against replay, commands have a counter and an expiry (command_gate.h).
class SealedBus final : public MessageBus {
 public:
  static constexpr std::size_t kSealBytes = 32;

  /// `inner` must outlive it. Seals with the first key, accepts any of them. \pre at least one key
  SealedBus(MessageBus& inner, std::vector<LinkKey> keys);
  ~SealedBus() override;

  void publish(std::string_view channel, std::span<const std::uint8_t> bytes) override;
  void subscribe(std::string_view channel, Handler handler) override;
  bool handle(std::chrono::milliseconds timeout) override { return inner_.handle(timeout); }

  static bool sealed(std::string_view channel);
  std::uint64_t refused() const { return refused_; }

 private:
  bool opens(std::string_view channel, std::span<const std::uint8_t> bytes) const;

  MessageBus& inner_;
  std::vector<LinkKey> keys_;
  std::uint64_t refused_ = 0;  // touched by the thread that calls handle
};

/// A message of a known layout (wire_layout.h) as it was recorded from the network, without the seal that may be behind
/// it: without the key it can't be checked. Bytes that fit neither way come back as they are.
std::span<const std::uint8_t> without_seal(std::string_view layout, std::span<const std::uint8_t> bytes);

}  // namespace vantage
