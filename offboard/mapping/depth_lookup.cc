#include "offboard/mapping/depth_lookup.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace vantage {
namespace {

static_assert(static_cast<int>(DepthState::kConverged) == 1, "the kernels know the number");

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr int kFirstLevel = 2;  // blocks of 4 x 4 pixels

constexpr std::array<int, 9> kHalfWidths = {0, 1, 2, 3, 4, 6, 8, 11, DepthLookup::kMaxHalfWidth};

}  // namespace

void DepthLookup::prepare(const DepthMap& depth_map, const SensorModel& model) {
  width_ = depth_map.camera.width;
  height_ = depth_map.camera.height;
  windows_ready_ = 1;
  const CameraModel& camera = depth_map.camera;
  windows_[0].resize(depth_map.depth_m.size() + 1);
  surface_.resize(depth_map.depth_m.size() + 1);
  std::vector<float> x_squared(static_cast<std::size_t>(width_));
  for (int u = 0; u < width_; ++u) {
    const auto x = static_cast<float>((u - camera.cx) / camera.fx);
    x_squared[static_cast<std::size_t>(u)] = x * x;
  }
  std::size_t first = 0;
  for (int v = 0; v < height_; ++v, first += x_squared.size()) {
    const auto y = static_cast<float>((v - camera.cy) / camera.fy);
    DepthRow row;
    row.depth_m = &depth_map.depth_m[first];
    row.sigma_m = &depth_map.sigma_m[first];
    row.state = reinterpret_cast<const std::uint8_t*>(&depth_map.state[first]);
    row.x_squared = x_squared.data();
    row.one_plus_y_squared = 1 + y * y;
    row.max_range_m = static_cast<float>(model.max_range_m);
    row.margin_sigmas = static_cast<float>(model.free_margin_sigmas);
    row.free_limit = &windows_[0][first];
    row.surface = &surface_[first];
    row.width = x_squared.size();
    kernels_.prepare_row(row);
  }
  windows_[0].back() = 0;
  surface_.back() = kInfinity;
  build_pyramid();
}

const std::vector<float>& DepthLookup::free_limit_in_window(int half_width) {
  std::size_t wanted = 0;
  while (wanted + 1 < kHalfWidths.size() && kHalfWidths[wanted + 1] <= half_width) ++wanted;
  const auto w = static_cast<std::size_t>(width_), h = static_cast<std::size_t>(height_);
  for (; windows_ready_ <= wanted; ++windows_ready_) {
    // Three windows of the last half width, shifted by what this one is wider, cover this one without a gap.
    const std::vector<float>& narrow = windows_[windows_ready_ - 1];
    std::vector<float>& wide = windows_[windows_ready_];
    const auto shift = static_cast<std::size_t>(kHalfWidths[windows_ready_] - kHalfWidths[windows_ready_ - 1]);
    wide.resize(w * h + 1);
    rows_.resize(w * h);
    for (std::size_t v = 0; v < h; ++v) {
      const float* in = &narrow[v * w];
      float* out = &rows_[v * w];
      for (std::size_t u = 0; u < w; ++u) {
        if (u == shift && w > 2 * shift) {
          kernels_.max_of_three(in, in + shift, in + 2 * shift, w - 2 * shift, out + shift);
          u = w - shift;
        }
        out[u] = std::max({in[u < shift ? 0 : u - shift], in[u], in[std::min(u + shift, w - 1)]});
      }
    }
    for (std::size_t v = 0; v < h; ++v) {
      kernels_.max_of_three(&rows_[(v < shift ? 0 : v - shift) * w], &rows_[v * w],
                            &rows_[std::min(v + shift, h - 1) * w], w, &wide[v * w]);
    }
    wide.back() = 0;
  }
  return windows_[wanted];
}

void DepthLookup::build_pyramid() {
  const auto blocks = [](int pixels, int level) { return (pixels + (1 << level) - 1) >> level; };
  pyramid_.resize(1);
  PyramidLevel& first = pyramid_[0];
  first.width = blocks(width_, kFirstLevel);
  first.height = blocks(height_, kFirstLevel);
  first.blocks.resize(static_cast<std::size_t>(first.width) * static_cast<std::size_t>(first.height));
  const auto width = static_cast<std::size_t>(width_);
  std::vector<float> lowest(width), highest(width);
  for (int block_v = 0; block_v < first.height; ++block_v) {
    std::fill(lowest.begin(), lowest.end(), kInfinity);
    std::fill(highest.begin(), highest.end(), -kInfinity);
    for (int v = block_v << kFirstLevel; v < std::min((block_v + 1) << kFirstLevel, height_); ++v) {
      const float* free_limit = &windows_[0][static_cast<std::size_t>(v) * width];
      const float* surface = &surface_[static_cast<std::size_t>(v) * width];
      for (std::size_t u = 0; u < width; ++u) {
        const float free = free_limit[u], reach = surface[u] < kInfinity && surface[u] > free ? surface[u] : free;
        lowest[u] = free < lowest[u] ? free : lowest[u];
        highest[u] = reach > highest[u] ? reach : highest[u];
      }
    }
    Bounds* row = &first.blocks[static_cast<std::size_t>(block_v) * static_cast<std::size_t>(first.width)];
    for (int block_u = 0; block_u < first.width; ++block_u) {
      Bounds block{kInfinity, 0};
      for (int u = block_u << kFirstLevel; u < std::min((block_u + 1) << kFirstLevel, width_); ++u) {
        block.min_free = std::min(block.min_free, lowest[static_cast<std::size_t>(u)]);
        block.max_reach = std::max(block.max_reach, highest[static_cast<std::size_t>(u)]);
      }
      row[block_u] = block.max_reach > 0 ? block : Bounds{0, -kInfinity};
    }
  }
  while (pyramid_.back().width > 1 || pyramid_.back().height > 1) {
    const PyramidLevel& fine = pyramid_.back();
    PyramidLevel coarse{blocks(fine.width, 1), blocks(fine.height, 1), {}};
    coarse.blocks.assign(static_cast<std::size_t>(coarse.width) * static_cast<std::size_t>(coarse.height),
                         {kInfinity, -kInfinity});
    std::size_t i = 0;
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
  // The finest level at which the rectangle meets at most 4 x 4 blocks.
  std::size_t level = 0;
  int shift = kFirstLevel;
  while (std::max((u_max >> shift) - (u_min >> shift), (v_max >> shift) - (v_min >> shift)) > 3) {
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
