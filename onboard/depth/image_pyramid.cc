#include "onboard/depth/image_pyramid.h"

#include <cstring>

namespace vantage {
namespace {

constexpr int kSpareBytes = 64;

}  // namespace

ImagePyramid::ImagePyramid(int width, int height) {
  for (int l = 0; l < kLevels; ++l) {
    Storage& level = levels_[static_cast<std::size_t>(l)];
    level.width = width >> l;
    level.height = height >> l;
    level.stride = (level.width + kSpareBytes - 1) / kSpareBytes * kSpareBytes;
    level.pixels.resize(static_cast<std::size_t>(level.stride) * static_cast<std::size_t>(level.height) + kSpareBytes);
  }
}

void ImagePyramid::build(const GreyImage& image) {
  Storage& full = levels_[0];
  for (int y = 0; y < full.height; ++y) {
    std::memcpy(full.pixels.data() + static_cast<std::ptrdiff_t>(y) * full.stride,
                image.pixels.get() + y * image.stride, static_cast<std::size_t>(full.width));
  }
  for (std::size_t l = 1; l < kLevels; ++l) {
    const Storage& fine = levels_[l - 1];
    Storage& coarse = levels_[l];
    for (int y = 0; y < coarse.height; ++y) {
      const std::uint8_t* upper = fine.pixels.data() + static_cast<std::ptrdiff_t>(2 * y) * fine.stride;
      const std::uint8_t* lower = upper + fine.stride;
      std::uint8_t* out = coarse.pixels.data() + static_cast<std::ptrdiff_t>(y) * coarse.stride;
      for (int x = 0; x < coarse.width; ++x) {
        out[x] = static_cast<std::uint8_t>((upper[2 * x] + upper[2 * x + 1] + lower[2 * x] + lower[2 * x + 1] + 2) / 4);
      }
    }
  }
}

ImagePyramid::Level ImagePyramid::level(int l) const {
  const Storage& s = levels_[static_cast<std::size_t>(l)];
  return {.pixels = s.pixels.data(), .width = s.width, .height = s.height, .stride = s.stride};
}

}  // namespace vantage
