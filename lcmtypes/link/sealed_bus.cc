#include "lcmtypes/link/sealed_bus.h"

#include <algorithm>
#include <array>
#include <stdexcept>
#include <utility>

#include <sodium.h>

namespace vantage {
namespace {

static_assert(SealedBus::kSealBytes == crypto_auth_hmacsha512256_BYTES);
static_assert(std::tuple_size_v<LinkKey> == crypto_auth_hmacsha512256_KEYBYTES);

constexpr std::string_view kDomain = "vantage-link-2";

using Seal = std::array<std::uint8_t, SealedBus::kSealBytes>;

void add_text(crypto_auth_hmacsha512256_state* state, std::string_view text) {
  // Its closing zero too, so that no other division of the same letters gives the same seal.
  const std::string closed(text);
  crypto_auth_hmacsha512256_update(state, reinterpret_cast<const unsigned char*>(closed.c_str()), closed.size() + 1);
}

Seal seal_of(const LinkKey& key, std::string_view channel, std::span<const std::uint8_t> bytes) {
  crypto_auth_hmacsha512256_state state;
  crypto_auth_hmacsha512256_init(&state, key.data(), key.size());
  add_text(&state, kDomain);
  add_text(&state, channel);
  crypto_auth_hmacsha512256_update(&state, bytes.data(), bytes.size());
  Seal seal;
  crypto_auth_hmacsha512256_final(&state, seal.data());
  return seal;
}

}  // namespace

SealedBus::SealedBus(MessageBus& inner, std::vector<LinkKey> keys) : inner_(inner), keys_(std::move(keys)) {
  if (sodium_init() < 0) throw std::runtime_error("libsodium finds no source of randomness");
  if (keys_.empty()) throw std::invalid_argument("SealedBus: no key");
}

SealedBus::~SealedBus() {
  for (LinkKey& key : keys_) sodium_memzero(key.data(), key.size());
}

bool SealedBus::sealed(std::string_view channel) {
  return channel != channel::kDepthChunk && channel != channel::kPreview;
}

void SealedBus::publish(std::string_view channel, std::span<const std::uint8_t> bytes) {
  if (!sealed(channel)) return inner_.publish(channel, bytes);
  std::vector<std::uint8_t> letter(bytes.begin(), bytes.end());
  const Seal seal = seal_of(keys_.front(), channel, bytes);
  letter.insert(letter.end(), seal.begin(), seal.end());
  inner_.publish(channel, letter);
}

bool SealedBus::opens(std::string_view channel, std::span<const std::uint8_t> bytes) const {
  if (bytes.size() < kSealBytes) return false;
  const std::span<const std::uint8_t> seal = bytes.last(kSealBytes);
  return std::any_of(keys_.begin(), keys_.end(), [&](const LinkKey& key) {
    return sodium_memcmp(seal_of(key, channel, bytes.first(bytes.size() - kSealBytes)).data(), seal.data(),
                         kSealBytes) == 0;
  });
}

void SealedBus::subscribe(std::string_view channel, Handler handler) {
  if (!sealed(channel)) return inner_.subscribe(channel, std::move(handler));
  inner_.subscribe(
      channel, [this, name = std::string(channel), handler = std::move(handler)](std::span<const std::uint8_t> bytes) {
        if (!opens(name, bytes)) {
          ++refused_;
          return;
        }
        handler(bytes.first(bytes.size() - kSealBytes));
      });
}

std::span<const std::uint8_t> without_seal(std::string_view layout, std::span<const std::uint8_t> bytes) {
  if (bytes.size() < SealedBus::kSealBytes || layout_fits(layout, bytes)) return bytes;
  const std::span<const std::uint8_t> message = bytes.first(bytes.size() - SealedBus::kSealBytes);
  return layout_fits(layout, message) ? message : bytes;
}

}  // namespace vantage
