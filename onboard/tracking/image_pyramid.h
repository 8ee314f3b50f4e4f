#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

#include "drivers/camera/frame_source.h"

namespace vantage::tracking {

/// One level of a pyramid. Pixel (0, 0) is the centre of the upper left pixel.
struct ImageView {
  const std::uint8_t* data = nullptr;
  int width = 0;
  int height = 0;
  std::ptrdiff_t stride = 0;

  const std::uint8_t* row(int v) const { return data + v * stride; }
  /// True when the pixel keeps `border` pixels from every edge; false for NaN.
  bool inside(double u, double v, double border) const {
    return u >= border && v >= border && u < width - 1 - border && v < height - 1 - border;
  }
};

/// Bilinear grey value; (u, v) must be inside(u, v, 0).
inline float interpolate(const ImageView& image, float u, float v) {
  const int iu = static_cast<int>(u), iv = static_cast<int>(v);
  const float du = u - static_cast<float>(iu), dv = v - static_cast<float>(iv);
  const std::uint8_t* p = image.row(iv) + iu;
  const std::uint8_t* q = p + image.stride;
  return (1 - dv) * ((1 - du) * p[0] + du * p[1]) + dv * ((1 - du) * q[0] + du * q[1]);
}

/// A grey image and its halvings: level l has pixels of 2^l x 2^l original ones. As everywhere in the field,
/// coordinates of a level are those of level 0 divided by 2^l; `to_level` and `to_base` know of the half pixel between
/// the two.
class ImagePyramid {
 public:
  static constexpr int kLevels = 5;

  /// Copies the image and halves it; memory of an earlier image of the same size is used again.
  void build(const GreyImage& image);
  ImageView level(int l) const { return levels_[static_cast<std::size_t>(l)]; }
  int width() const { return levels_[0].width; }
  int height() const { return levels_[0].height; }

 private:
  std::vector<std::uint8_t> pixels_;
  std::vector<ImageView> levels_;
};

/// Coordinate of level l of a coordinate of level 0: the centre of the first pixel of level l lies at (2^l - 1) / 2.
inline double to_level(double coordinate, int l) {
  const double scale = 1 << l;
  return (coordinate + 0.5) / scale - 0.5;
}
inline double to_base(double coordinate, int l) {
  const double scale = 1 << l;
  return (coordinate + 0.5) * scale - 0.5;
}

/// Pyramids whose memory is used again once nobody holds them. Any thread may let go of one; one thread builds.
class PyramidPool {
 public:
  PyramidPool() : free_(std::make_shared<FreeList>()) {}
  std::shared_ptr<const ImagePyramid> build(const GreyImage& image);

 private:
  struct FreeList {
    std::mutex mutex;  // guards `pyramids`
    std::vector<std::unique_ptr<ImagePyramid>> pyramids;
  };
  std::shared_ptr<FreeList> free_;
};

}  // namespace vantage::tracking
