#include "lcmtypes/link/depth_edges.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace vantage {
namespace {

/// Marks both ends of every step between neighbouring measured pixels of one row or column.
void mark_steps(const float* inverse, std::uint8_t* edge, int count, std::ptrdiff_t stride,
                const DepthEdgeOptions& options) {
  const auto jump = static_cast<float>(options.jump_per_m), slope = static_cast<float>(options.slope_per_m);
  int last = -1;
  for (int i = 0; i < count; ++i) {
    const float value = inverse[i * stride];
    if (value == 0) continue;
    if (last >= 0 && std::abs(value - inverse[last * stride]) > jump + slope * static_cast<float>(i - last - 1)) {
      edge[i * stride] = edge[last * stride] = 1;
    }
    last = i;
  }
}

/// Spreads the marks of one row or column to `radius` neighbours on both sides.
void widen(const std::uint8_t* in, std::uint8_t* out, int count, std::ptrdiff_t stride, int radius) {
  int reach = -1;  // last pixel that the marks passed so far spread to
  for (int i = 0; i < count + radius; ++i) {
    if (i < count && in[i * stride] != 0) reach = i + 2 * radius;
    if (i >= radius) out[(i - radius) * stride] = i <= reach ? 1 : 0;
  }
}

}  // namespace

void mark_depth_edges(DepthMap* map, const DepthEdgeOptions& options) {
  const int width = map->camera.width, height = map->camera.height;
  std::vector<float> inverse(map->depth_m.size());
  for (std::size_t i = 0; i < inverse.size(); ++i) {
    const bool measured = map->state[i] == DepthState::kConverged || map->state[i] == DepthState::kEdge;
    inverse[i] = measured ? 1 / map->depth_m[i] : 0;
  }
  std::vector<std::uint8_t> edge(inverse.size()), along_rows(inverse.size());
  const auto row_start = [width](int v) { return static_cast<std::size_t>(v) * static_cast<std::size_t>(width); };
  for (int v = 0; v < height; ++v) mark_steps(&inverse[row_start(v)], &edge[row_start(v)], width, 1, options);
  for (std::size_t u = 0; u < static_cast<std::size_t>(width); ++u) {
    mark_steps(&inverse[u], &edge[u], height, width, options);
  }
  for (int v = 0; v < height; ++v) widen(&edge[row_start(v)], &along_rows[row_start(v)], width, 1, options.radius_px);
  for (std::size_t u = 0; u < static_cast<std::size_t>(width); ++u) {
    widen(&along_rows[u], &edge[u], height, width, options.radius_px);
  }
  for (std::size_t i = 0; i < edge.size(); ++i) {
    if (edge[i] != 0 && map->state[i] == DepthState::kConverged) map->state[i] = DepthState::kEdge;
  }
}

}  // namespace vantage
