#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "drivers/camera/frame_source.h"

namespace vantage {

/// An image and its halves, each with bytes to spare behind its end so that a reader of four bytes at any pixel stays
/// inside. Pixel (x, y) of a level covers pixels (2x, 2y) to (2x + 1, 2y + 1) of the one below.
class ImagePyramid {
 public:
  static constexpr int kLevels = 3;

  struct Level {
    const std::uint8_t* pixels = nullptr;
    int width = 0;
    int height = 0;
    int stride = 0;  ///< bytes
  };

  /// For images of one size, at least 32 x 32. Allocates here only.
  ImagePyramid(int width, int height);

  /// Copies the image in and halves it. \pre it has the pyramid's size.
  void build(const GreyImage& image);

  Level level(int l) const;

 private:
  struct Storage {
    int width = 0, height = 0, stride = 0;
    std::vector<std::uint8_t> pixels;
  };
  std::array<Storage, kLevels> levels_;
};

}  // namespace vantage
