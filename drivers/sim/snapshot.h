#pragma once

#include <cstdint>
#include <filesystem>
#include <span>

namespace vantage::sim {

/// Writes a grey image, row-major and without gaps, as the name's ending says (.png, .pgm, .jpg, ...), whole or not at
/// all. \throws InputError when the ending is unknown or the file can't be written.
void write_image(const std::filesystem::path& path, int width, int height, std::span<const std::uint8_t> grey);

}  // namespace vantage::sim
