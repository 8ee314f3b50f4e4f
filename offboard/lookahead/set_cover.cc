#include "offboard/lookahead/set_cover.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace vantage {
namespace {

const std::array<Eigen::Vector3f, kFacings>& facings() {
  static const std::array<Eigen::Vector3f, kFacings> kCorners = [] {
    const float golden = (1 + std::sqrt(5.0F)) / 2;
    std::array<Eigen::Vector3f, kFacings> corners;
    std::size_t i = 0;
    for (const float a : {-1.0F, 1.0F}) {
      for (const float b : {-golden, golden}) {
        for (const Eigen::Vector3f& corner : {Eigen::Vector3f{0, a, b}, {a, b, 0}, {b, 0, a}}) {
          corners[i++] = corner.normalized();
        }
      }
    }
    return corners;
  }();
  return kCorners;
}

}  // namespace

std::array<float, kFacings> measured_by_facing(float share, const Eigen::Vector3f& to_camera) {
  std::array<float, kFacings> measured;
  measured.fill(share);
  if (to_camera.isZero()) return measured;
  // Of a sphere, the cap beyond the cosine 1 - 2 share is that share. Its edge is soft, as wide as kEdge in the cosine.
  constexpr float kEdge = 0.5F;
  const float edge = 1 - 2 * share;
  for (std::size_t k = 0; k < kFacings; ++k) {
    measured[k] = std::clamp((facings()[k].dot(to_camera) - edge) / kEdge + 0.5F, 0.0F, 1.0F);
  }
  // Of twelve directions the cap is only about that share: the rest goes to all, or comes from all.
  const float mean = std::accumulate(measured.begin(), measured.end(), 0.0F) / kFacings;
  for (float& part : measured) part = mean > share ? part * share / mean : 1 - (1 - part) * (1 - share) / (1 - mean);
  return measured;
}

SetCover::SetCover(const std::vector<std::vector<ExpectedVoxel>>& views, const std::vector<float>& prior) {
  constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();
  std::vector<std::uint32_t> place(prior.size(), kNone);
  for (const std::vector<ExpectedVoxel>& view : views) {
    std::vector<Seen>& mine = views_.emplace_back();
    mine.reserve(view.size());
    for (const ExpectedVoxel& seen : view) {
      if (place[seen.voxel] == kNone) {
        place[seen.voxel] = static_cast<std::uint32_t>(prior_.size());
        prior_.push_back(prior[seen.voxel] / kFacings);
      }
      mine.push_back({place[seen.voxel], measured_by_facing(seen.probability, seen.to_camera)});
    }
  }
  open_.resize(prior_.size());
  for (std::size_t i = 0; i < prior_.size(); ++i) open_[i].fill(prior_[i]);
}

double SetCover::gain(std::size_t view) const {
  Shares sums{};
  for (const Seen& seen : views_[view]) {
    const Shares& open = open_[seen.place];
    for (std::size_t k = 0; k < kFacings; ++k) sums[k] += open[k] * seen.measured[k];
  }
  return std::accumulate(sums.begin(), sums.end(), 0.0);
}

void SetCover::take(std::size_t view) {
  taken_.push_back(view);
  for (const Seen& seen : views_[view]) {
    Shares& open = open_[seen.place];
    for (std::size_t k = 0; k < kFacings; ++k) open[k] *= 1 - seen.measured[k];
  }
}

void SetCover::clear() {
  // What no taken view sees was never changed.
  for (const std::size_t view : taken_) {
    for (const Seen& seen : views_[view]) open_[seen.place].fill(prior_[seen.place]);
  }
  taken_.clear();
}

}  // namespace vantage
