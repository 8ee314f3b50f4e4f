// The body of the projection's kernels, included by one file an instruction set: loops that the compiler vectorises.
// To be compiled without contraction of a * b + c, so that all give the same verdicts.

#include <cmath>
#include <cstddef>

#include "offboard/mapping/voxel_projection.h"

namespace vantage {
namespace {

constexpr std::size_t kLanes = 64;  // a layer of a brick at a time
constexpr float kNearest = 1e-4F;   // m; a centre nearer the camera's plane projects nowhere useful

void classify_layer(const VoxelProjection& p, std::size_t layer, std::uint8_t* missed, std::uint8_t* mark) {
  alignas(64) float depth[kLanes], slant[kLanes], free_limit[kLanes], surface[kLanes];
  alignas(64) std::int32_t pixel[kLanes];
  const auto z = static_cast<float>(layer);
  const float width = static_cast<float>(p.width), height = static_cast<float>(p.height);
  const std::int32_t outside = p.width * p.height;
  for (std::size_t i = 0; i < kLanes; ++i) {
    const auto x = static_cast<float>(static_cast<std::int32_t>(i & 7));
    const auto y = static_cast<float>(static_cast<std::int32_t>(i >> 3));
    const float px = p.first[0] + x * p.step_x[0] + y * p.step_y[0] + z * p.step_z[0];
    const float py = p.first[1] + x * p.step_x[1] + y * p.step_y[1] + z * p.step_z[1];
    const float pz = p.first[2] + x * p.step_x[2] + y * p.step_y[2] + z * p.step_z[2];
    const float inverse = 1 / pz, across = px * inverse, down = py * inverse;
    const float u = p.fx * across + p.cx, v = p.fy * down + p.cy;
    const bool on_image =
        (pz > kNearest) & (u >= -p.margin) & (v >= -p.margin) & (u < width + p.margin) & (v < height + p.margin);
    // A voxel whose centre lies beside the image asks the nearest pixel: part of it is seen.
    const float low_u = u > 0 ? u : 0, low_v = v > 0 ? v : 0;
    const float safe_u = on_image & (low_u < width) ? low_u : width - 1;
    const float safe_v = on_image & (low_v < height) ? low_v : height - 1;
    const std::int32_t at = static_cast<std::int32_t>(safe_v) * p.width + static_cast<std::int32_t>(safe_u);
    pixel[i] = on_image ? at : outside;
    depth[i] = pz;
    slant[i] = 1 + across * across + down * down;  // (length of the ray / depth)^2
  }
  for (std::size_t i = 0; i < kLanes; ++i) free_limit[i] = p.free_limit[pixel[i]];
  std::int32_t free_voxels = 0;
  for (std::size_t i = 0; i < kLanes; ++i) {
    const std::int32_t seen_through = (depth[i] > kNearest) & (depth[i] < free_limit[i]);
    missed[i] = static_cast<std::uint8_t>(seen_through);
    free_voxels += seen_through;
  }
  if (free_voxels == static_cast<std::int32_t>(kLanes)) {  // as in most layers: nothing left to mark
    for (std::size_t i = 0; i < kLanes; ++i) mark[i] = 0;
    return;
  }
  for (std::size_t i = 0; i < kLanes; ++i) surface[i] = p.surface[pixel[i]];
  for (std::size_t i = 0; i < kLanes; ++i) {
    // Of the surfaces in the footprint the farthest is the nearest to the voxel behind them.
    const float nearest = free_limit[i] > surface[i] ? free_limit[i] : surface[i];
    const float behind = (depth[i] - nearest) * __builtin_sqrtf(slant[i]);
    const bool marked = (depth[i] > surface[i]) & (behind >= 0) & (behind <= p.occlusion_range_m) & (missed[i] == 0);
    const float clamped = marked ? behind : 0;
    const auto step = static_cast<std::int32_t>(1.5F + clamped * p.marks_per_metre);
    mark[i] = static_cast<std::uint8_t>(marked ? step : 0);
  }
}

void classify(const VoxelProjection& projection, VoxelVerdicts* verdicts) {
  for (std::size_t layer = 0; layer < 8; ++layer) {
    classify_layer(projection, layer, verdicts->missed.data() + kLanes * layer, verdicts->mark.data() + kLanes * layer);
  }
  std::int32_t missed = 0, marked = 0;
  for (std::size_t i = 0; i < 512; ++i) {
    missed += verdicts->missed[i];
    marked += verdicts->mark[i] != 0;
  }
  verdicts->missed_count = missed;
  verdicts->mark_count = marked;
}

void prepare_row(const DepthRow& row) {
  const float* __restrict depths = row.depth_m;
  const float* __restrict sigmas = row.sigma_m;
  const std::uint8_t* __restrict states = row.state;
  const float* __restrict x_squared = row.x_squared;
  float* __restrict free_limit = row.free_limit;
  float* __restrict surface = row.surface;
  const float y = row.one_plus_y_squared, range = row.max_range_m, margin = row.margin_sigmas;
  for (std::size_t u = 0; u < row.width; ++u) {
    const bool usable = states[u] == 1;  // DepthState::kConverged
    const float depth = depths[u];
    const float limit = range / __builtin_sqrtf(y + x_squared[u]);  // the range along the ray, as a depth
    const float before = depth - margin * sigmas[u];
    const float free = before < limit ? before : limit;
    free_limit[u] = usable & (free > 0) ? free : 0.0F;
    surface[u] = usable & (depth <= limit) ? depth : __builtin_inff();
  }
}

void max_of_three(const float* __restrict a, const float* __restrict b, const float* __restrict c, std::size_t n,
                  float* __restrict out) {
  for (std::size_t i = 0; i < n; ++i) {
    const float ab = a[i] > b[i] ? a[i] : b[i];
    out[i] = ab > c[i] ? ab : c[i];
  }
}

}  // namespace
}  // namespace vantage
