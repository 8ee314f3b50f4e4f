#pragma once

#include <cstdint>
#include <string_view>

namespace vantage {

/// CRC-32 of zlib, PNG and MCAP (reflected polynomial 0xEDB88320). `crc` is that of the bytes before.
std::uint32_t crc32(std::string_view bytes, std::uint32_t crc = 0);

}  // namespace vantage
