#include "offboard/mapping/region.h"

#include <cmath>

namespace vantage {
namespace {

bool fail(std::string* why, std::string reason) {
  if (why != nullptr) *why = std::move(reason);
  return false;
}

}  // namespace

Region Region::cube(const Eigen::Vector3d& center, double edge_m, double resolution_m) {
  Region region;
  region.resolution_m = resolution_m;
  const double edge_voxels = std::round(edge_m / resolution_m);
  // Out of range stays out of range, for valid() to refuse.
  const bool representable = edge_voxels >= 0 && edge_voxels <= 1e6;
  region.size_voxels.setConstant(representable ? static_cast<int>(edge_voxels) : -1);
  for (int i = 0; i < 3; ++i) {
    region.min_corner[i] = std::round(center[i] / resolution_m - edge_voxels / 2) * resolution_m;
  }
  return region;
}

bool Region::valid(std::string* why) const {
  if (!min_corner.allFinite()) return fail(why, "the region's corner is not finite");
  if (!(std::isfinite(resolution_m) && resolution_m > 0)) {
    return fail(why, "the region's resolution must be finite and positive, e.g. 0.01 m");
  }
  if ((size_voxels.array() < 1).any()) return fail(why, "the region is smaller than a voxel");
  if ((size_voxels.array() > kMaxSizeVoxels).any()) {
    return fail(why, "the region is more than " + std::to_string(kMaxSizeVoxels) + " voxels wide");
  }
  // Beyond this a double no longer tells neighbouring voxels' faces apart by a thousandth of a voxel.
  if (min_corner.cwiseAbs().maxCoeff() / resolution_m > 1e12) {
    return fail(why, "the region lies too far from the origin");
  }
  return true;
}

bool Region::aligned() const {
  const Eigen::Array3d corner = min_corner.array() / resolution_m;
  return ((corner - corner.round()).abs() < 1e-6).all();
}

bool Region::voxel_at(const Eigen::Vector3d& point, Eigen::Vector3i* voxel) const {
  const Eigen::Array3d at = to_voxels(point).array().floor();
  if (!((at >= 0).all() && (at < size_voxels.cast<double>().array()).all())) return false;  // false for NaN
  *voxel = at.cast<int>();
  return true;
}

}  // namespace vantage
