#include "offboard/session/surface_coverage.h"

#include <cmath>

namespace vantage {

SurfaceCoverage::SurfaceCoverage(std::vector<Eigen::Vector3f> surface, double distance_m)
    : surface_(std::move(surface)), distance_m_(static_cast<float>(distance_m)) {
  clear();
}

void SurfaceCoverage::clear() {
  open_.clear();
  covered_ = 0;
  for (std::size_t i = 0; i < surface_.size(); ++i) {
    open_[cell_at(index_of(surface_[i]))].push_back(static_cast<std::uint32_t>(i));
  }
}

SurfaceCoverage::Cell SurfaceCoverage::cell_at(const Eigen::Vector3i& index) const {
  constexpr int kBits = 21;  // each: 2^20 cells of 8 mm are 8 km to either side
  constexpr Cell kMask = (Cell{1} << kBits) - 1;
  return (index.x() & kMask) << 2 * kBits | (index.y() & kMask) << kBits | (index.z() & kMask);
}

Eigen::Vector3i SurfaceCoverage::index_of(const Eigen::Vector3f& point) const {
  return (point / distance_m_).array().floor().cast<int>();
}

void SurfaceCoverage::add(const std::vector<Eigen::Vector3f>& points) {
  const float squared = distance_m_ * distance_m_;
  for (const Eigen::Vector3f& point : points) {
    const Eigen::Vector3i centre = index_of(point);
    for (int neighbour = 0; neighbour < 27; ++neighbour) {
      const Eigen::Vector3i offset(neighbour % 3 - 1, neighbour / 3 % 3 - 1, neighbour / 9 - 1);
      const auto cell = open_.find(cell_at(centre + offset));
      if (cell == open_.end()) continue;
      covered_ +=
          std::erase_if(cell->second, [&](std::uint32_t i) { return (surface_[i] - point).squaredNorm() < squared; });
      if (cell->second.empty()) open_.erase(cell);
    }
  }
}

double SurfaceCoverage::share() const { return static_cast<double>(covered_) / static_cast<double>(surface_.size()); }

}  // namespace vantage
