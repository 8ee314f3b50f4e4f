#include "offboard/mapping/tsdf_integrator.h"

#include <algorithm>
#include <cmath>

namespace vantage {

TsdfIntegrator::TsdfIntegrator(const DepthMap& depth_map, const std::vector<float>& surface, Tsdf* tsdf)
    : depth_map_(depth_map),
      surface_(surface),
      tsdf_(*tsdf),
      truncation_(static_cast<float>(tsdf->truncation_m())),
      jump_(static_cast<float>(tsdf->jump_m())),
      reference_sigma_(static_cast<float>(tsdf->region().resolution_m / 4)) {}

bool TsdfIntegrator::surface_at(float u, float v, float* depth, float* sigma) const {
  const int width = depth_map_.camera.width, height = depth_map_.camera.height;
  if (!(u >= 0 && v >= 0 && u < static_cast<float>(width - 1) && v < static_cast<float>(height - 1))) return false;
  const int left = static_cast<int>(u), top = static_cast<int>(v);
  const float right_share = u - static_cast<float>(left), bottom_share = v - static_cast<float>(top);
  const auto i = static_cast<std::size_t>(top) * static_cast<std::size_t>(width) + static_cast<std::size_t>(left);
  const auto below = i + static_cast<std::size_t>(width);
  const float a = surface_[i], b = surface_[i + 1], c = surface_[below], d = surface_[below + 1];
  const float nearest = std::min(std::min(a, b), std::min(c, d)), farthest = std::max(std::max(a, b), std::max(c, d));
  if (!(farthest - nearest <= jump_)) return false;  // also when one is infinite, or all
  const float upper = a + right_share * (b - a), lower = c + right_share * (d - c);
  *depth = upper + bottom_share * (lower - upper);
  *sigma =
      depth_map_
          .sigma_m[right_share < 0.5F ? (bottom_share < 0.5F ? i : below) : (bottom_share < 0.5F ? i + 1 : below + 1)];
  return true;
}

void TsdfIntegrator::integrate(std::size_t brick, const VoxelProjection& p) {
  std::array<float, 512> distance, weight;
  bool in_band = false;
  std::size_t i = 0;
  for (int z = 0; z < 8; ++z) {
    for (int y = 0; y < 8; ++y) {
      const auto fy = static_cast<float>(y), fz = static_cast<float>(z);
      for (int x = 0; x < 8; ++x, ++i) {
        const auto fx = static_cast<float>(x);
        weight[i] = 0;
        const float px = p.first[0] + fx * p.step_x[0] + fy * p.step_y[0] + fz * p.step_z[0];
        const float py = p.first[1] + fx * p.step_x[1] + fy * p.step_y[1] + fz * p.step_z[1];
        const float pz = p.first[2] + fx * p.step_x[2] + fy * p.step_y[2] + fz * p.step_z[2];
        if (!(pz > 1e-4F)) continue;
        const float across = px / pz, down = py / pz;
        float depth = 0, sigma = 0;
        // The projection's c holds the half pixel that rounds; here it must go.
        if (!surface_at(p.fx * across + p.cx - 0.5F, p.fy * down + p.cy - 0.5F, &depth, &sigma)) continue;
        const float along = (depth - pz) * std::sqrt(1 + across * across + down * down);
        if (along < -truncation_) continue;
        distance[i] = std::min(along, truncation_);
        in_band = in_band || along < truncation_;
        const float ratio = sigma / reference_sigma_;
        weight[i] = 1 / (1 + ratio * ratio);
      }
    }
  }
  Tsdf::Brick* voxels = tsdf_.find(brick);
  if (voxels == nullptr) {
    if (!in_band) return;
    voxels = &tsdf_.allocate(brick);
  }
  for (i = 0; i < 512; ++i) {
    if (weight[i] == 0) continue;
    const float sum = voxels->weight[i] + weight[i];
    voxels->distance[i] += (distance[i] - voxels->distance[i]) * (weight[i] / sum);
    voxels->weight[i] = sum;
  }
}

}  // namespace vantage
