#pragma once

#include <cstdint>
#include <unordered_map>
#include <vector>

#include <Eigen/Core>

namespace vantage {

/// Surface coverage (Eq. 14): the share of the model's surface points that have a reconstructed point nearer than
/// `distance_m`.
class SurfaceCoverage {
 public:
  /// `surface`: points of the true surface, world, m. \pre not empty, distance_m > 0
  SurfaceCoverage(std::vector<Eigen::Vector3f> surface, double distance_m = 0.008);

  /// More reconstructed points, world, m.
  void add(const std::vector<Eigen::Vector3f>& points);
  /// Forgets them.
  void clear();

  double share() const;

 private:
  using Cell = std::int64_t;
  Cell cell_at(const Eigen::Vector3i& index) const;
  Eigen::Vector3i index_of(const Eigen::Vector3f& point) const;

  std::vector<Eigen::Vector3f> surface_;
  float distance_m_;
  std::unordered_map<Cell, std::vector<std::uint32_t>> open_;  // surface points not covered yet, in cells of distance_m
  std::size_t covered_ = 0;
};

}  // namespace vantage
