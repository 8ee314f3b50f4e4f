#include "offboard/mapping/depth_lookup.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace vantage {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr int kFirstLevel = 2;  // blocks of 4 x 4 pixels

/// Largest of each element and its two neighbours in a row of n.
void dilate_row(const float* in, int n, float* out) {
  if (n == 1) {
    out[0] = in[0];
    return;
  }
  out[0] = std::max(in[0], in[1]);
  for (int i = 1; i < n - 1; ++i) out[i] = std::max(std::max(in[i - 1], in[i]), in[i + 1]);
  out[n - 1] = std::max(in[n - 2], in[n - 1]);
}

/// Largest of each pixel's 3 x 3 neighbourhood.
std::vector<float> dilate(const std::vector<float>& image, int width, int height) {
  const auto w = static_cast<std::size_t>(width), h = static_cast<std::size_t>(height);
  std::vector<float> rows(image.size()), result(image.size());
  for (std::size_t v = 0; v < h; ++v) dilate_row(&image[v * w], width, &rows[v * w]);
  for (std::size_t v = 0; v < h; ++v) {
    const float* above = &rows[(v == 0 ? 0 : v - 1) * w];
    const float* here = &rows[v * w];
    const float* below = &rows[(v + 1 == h ? v : v + 1) * w];
    float* out = &result[v * w];
    for (std::size_t u = 0; u < w; ++u) out[u] = std::max(std::max(above[u], here[u]), below[u]);
  }
  return result;
}

}  // namespace

DepthLookup::DepthLookup(const DepthMap& depth_map, const SensorModel& model)
    : width_(depth_map.camera.width), height_(depth_map.camera.height), windows_(1) {
  const CameraModel& camera = depth_map.camera;
  windows_[0].resize(depth_map.depth_m.size());
  surface_.resize(depth_map.depth_m.size());
  const auto margin = static_cast<float>(model.free_margin_sigmas);
  const auto max_range = static_cast<float>(model.max_range_m);
  std::vector<float> x_squared(static_cast<std::size_t>(width_));
  for (int u = 0; u < width_; ++u) {
    const auto x = static_cast<float>((u - camera.cx) / camera.fx);
    x_squared[static_cast<std::size_t>(u)] = x * x;
  }
  std::size_t i = 0;
  for (int v = 0; v < height_; ++v) {
    const auto y = static_cast<float>((v - camera.cy) / camera.fy);
    const float row = 1 + y * y;
    for (std::size_t u = 0; u < x_squared.size(); ++u, ++i) {
      const bool usable = depth_map.state[i] == DepthState::kConverged;
      const float depth = depth_map.depth_m[i];
      const float limit = max_range / std::sqrt(row + x_squared[u]);  // range along the ray, as a depth
      windows_[0][i] = usable ? std::min(depth - margin * depth_map.sigma_m[i], limit) : -kInfinity;
      surface_[i] = usable && depth <= limit ? depth : kInfinity;
    }
  }
  build_pyramid();
}

const std::vector<float>& DepthLookup::free_limit_in_window(int half_width) {
  while (static_cast<int>(windows_.size()) <= half_width) windows_.push_back(dilate(windows_.back(), width_, height_));
  return windows_[static_cast<std::size_t>(half_width)];
}

void DepthLookup::build_pyramid() {
  const auto blocks = [](int pixels, int level) { return (pixels + (1 << level) - 1) >> level; };
  PyramidLevel first{blocks(width_, kFirstLevel), blocks(height_, kFirstLevel), {}};
  first.blocks.assign(static_cast<std::size_t>(first.width) * static_cast<std::size_t>(first.height),
                      {kInfinity, -kInfinity});
  std::size_t i = 0;
  for (int v = 0; v < height_; ++v) {
    Bounds* row = &first.blocks[static_cast<std::size_t>(v >> kFirstLevel) * static_cast<std::size_t>(first.width)];
    for (int u = 0; u < width_; ++u, ++i) {
      Bounds& block = row[u >> kFirstLevel];
      const float free = windows_[0][i], surface = surface_[i];
      block.min_free = std::min(block.min_free, free);
      block.max_reach = std::max(block.max_reach, surface < kInfinity ? std::max(free, surface) : free);
    }
  }
  pyramid_.push_back(std::move(first));
  while (pyramid_.back().width > 1 || pyramid_.back().height > 1) {
    const PyramidLevel& fine = pyramid_.back();
    PyramidLevel coarse{blocks(fine.width, 1), blocks(fine.height, 1), {}};
    coarse.blocks.assign(static_cast<std::size_t>(coarse.width) * static_cast<std::size_t>(coarse.height),
                         {kInfinity, -kInfinity});
    i = 0;
    for (int v = 0; v < fine.height; ++v) {
      for (int u = 0; u < fine.width; ++u, ++i) {
        Bounds& block = coarse.blocks[static_cast<std::size_t>(v >> 1) * static_cast<std::size_t>(coarse.width) +
                                      static_cast<std::size_t>(u >> 1)];
        block.min_free = std::min(block.min_free, fine.blocks[i].min_free);
        block.max_reach = std::max(block.max_reach, fine.blocks[i].max_reach);
      }
    }
    pyramid_.push_back(std::move(coarse));
  }
}

DepthLookup::Bounds DepthLookup::bounds(int u_min, int u_max, int v_min, int v_max) const {
  u_min = std::clamp(u_min, 0, width_ - 1);
  u_max = std::clamp(u_max, 0, width_ - 1);
  v_min = std::clamp(v_min, 0, height_ - 1);
  v_max = std::clamp(v_max, 0, height_ - 1);
  // The finest level at which the rectangle meets at most 3 x 3 blocks.
  std::size_t level = 0;
  int shift = kFirstLevel;
  while (std::max((u_max >> shift) - (u_min >> shift), (v_max >> shift) - (v_min >> shift)) > 2) {
    ++level;
    ++shift;
  }
  const PyramidLevel& blocks = pyramid_[level];
  Bounds result{kInfinity, -kInfinity};
  for (int v = v_min >> shift; v <= v_max >> shift; ++v) {
    const Bounds* row = &blocks.blocks[static_cast<std::size_t>(v) * static_cast<std::size_t>(blocks.width)];
    for (int u = u_min >> shift; u <= u_max >> shift; ++u) {
      result.min_free = std::min(result.min_free, row[u].min_free);
      result.max_reach = std::max(result.max_reach, row[u].max_reach);
    }
  }
  return result;
}

}  // namespace vantage
