#include "onboard/tracking/image_pyramid.h"

#include <cstring>

namespace vantage::tracking {
namespace {

void halve(const ImageView& from, std::uint8_t* to, int width, int height) {
  for (int v = 0; v < height; ++v) {
    const std::uint8_t* a = from.row(2 * v);
    const std::uint8_t* b = from.row(2 * v + 1);
    std::uint8_t* out = to + static_cast<std::ptrdiff_t>(v) * width;
    for (int u = 0; u < width; ++u, a += 2, b += 2) {
      out[u] = static_cast<std::uint8_t>((a[0] + a[1] + b[0] + b[1] + 2) >> 2);
    }
  }
}

}  // namespace

void ImagePyramid::build(const GreyImage& image) {
  std::size_t total = 0;
  int width = image.width, height = image.height;
  for (int l = 0; l < kLevels; ++l, width /= 2, height /= 2) {
    total += static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  }
  pixels_.resize(total);
  levels_.resize(kLevels);
  width = image.width;
  height = image.height;
  std::uint8_t* at = pixels_.data();
  for (int v = 0; v < height; ++v) {
    std::memcpy(at + static_cast<std::ptrdiff_t>(v) * width, image.pixels.get() + v * image.stride,
                static_cast<std::size_t>(width));
  }
  levels_[0] = {at, width, height, width};
  for (std::size_t l = 1; l < kLevels; ++l) {
    at += static_cast<std::ptrdiff_t>(width) * height;
    width /= 2;
    height /= 2;
    halve(levels_[l - 1], at, width, height);
    levels_[l] = {at, width, height, width};
  }
}

std::shared_ptr<const ImagePyramid> PyramidPool::build(const GreyImage& image) {
  std::unique_ptr<ImagePyramid> pyramid;
  {
    const std::lock_guard lock(free_->mutex);
    if (!free_->pyramids.empty()) {
      pyramid = std::move(free_->pyramids.back());
      free_->pyramids.pop_back();
    }
  }
  if (!pyramid) pyramid = std::make_unique<ImagePyramid>();
  pyramid->build(image);
  return {pyramid.release(), [list = free_](const ImagePyramid* done) {
            const std::lock_guard lock(list->mutex);
            list->pyramids.emplace_back(const_cast<ImagePyramid*>(done));
          }};
}

}  // namespace vantage::tracking
