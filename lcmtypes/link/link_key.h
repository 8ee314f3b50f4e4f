#pragma once

#include <array>
#include <cstdint>
#include <filesystem>

namespace vantage {

/// The secret that robot and workstation share. Whoever has it may command the robot.
using LinkKey = std::array<std::uint8_t, 32>;

/// A new random key.
LinkKey make_link_key();

/// Reads a key that `write_link_key` (vantage-keygen) wrote.
/// \throws InputError, naming the file and the mend, when there is none, it is not a key, or others than its owner may
/// read or write it (mode 0600 is demanded).
LinkKey read_link_key(const std::filesystem::path& path);

/// Writes a key with mode 0600. \throws InputError when the file exists (a lost key can't be had again) or can't be
/// made.
void write_link_key(const std::filesystem::path& path, const LinkKey& key);

}  // namespace vantage
