#include "lcmtypes/link/digest.h"

#include <stdexcept>

#include <sodium.h>

namespace vantage {

Digest digest_of(std::span<const std::uint8_t> bytes) {
  Digest digest;
  crypto_generichash(digest.data(), digest.size(), bytes.data(), bytes.size(), nullptr, 0);
  return digest;
}

std::int64_t random_id() {
  if (sodium_init() < 0) throw std::runtime_error("libsodium finds no source of randomness");
  std::int64_t id = 0;
  while (id == 0) {
    randombytes_buf(&id, sizeof id);
    id &= INT64_MAX;
  }
  return id;
}

}  // namespace vantage
