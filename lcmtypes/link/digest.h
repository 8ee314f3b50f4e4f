#pragma once

#include <array>
#include <cstdint>
#include <span>

namespace vantage {

/// BLAKE2b with 32 bytes.
using Digest = std::array<std::uint8_t, 32>;
Digest digest_of(std::span<const std::uint8_t> bytes);

/// A number that no other program and no other start of this one has: a session or boot id. Positive.
std::int64_t random_id();

}  // namespace vantage
