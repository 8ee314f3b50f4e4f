#pragma once

#include <span>

namespace vantage {

/// The bytes of surface_network.bin, which scripts/learn-surface-network wrote.
std::span<const unsigned char> surface_network_file();

}  // namespace vantage
