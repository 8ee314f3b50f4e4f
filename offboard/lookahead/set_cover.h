#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "offboard/lookahead/expected_view.h"

namespace vantage {

/// Directions that surface may face: the corners of an icosahedron.
constexpr std::size_t kFacings = 12;

/// How much a view measures of the surface in a voxel that faces each direction, when of all that the voxel may hold it
/// measures `share`: what faces it most. The mean is `share`. `to_camera`: unit vector; zero: the same of all.
std::array<float, kFacings> measured_by_facing(float share, const Eigen::Vector3f& to_camera);

/// Views as sets: which would cover most, together.
///
/// The gain of a set S is  sum over voxels x and directions n of prior(x) / 12 (1 - prod over v in S (1 - p_v(x, n))),
/// p_v(x, n) the probability that view v measures the surface in x if it faces n: what several views measure counts
/// once, and what two views from opposite sides measure of one voxel is not the same. Monotone and submodular:
/// what a view adds never grows by what was taken before.
class SetCover {
 public:
  /// `views`: what each view would see; `prior`: by voxel.
  SetCover(const std::vector<std::vector<ExpectedVoxel>>& views, const std::vector<float>& prior);

  /// What the view adds to those taken.
  double gain(std::size_t view) const;
  void take(std::size_t view);
  /// Forgets the views taken.
  void clear();

 private:
  using Shares = std::array<float, kFacings>;
  struct Seen {
    std::uint32_t place;  // in open_
    Shares measured;
  };
  std::vector<std::vector<Seen>> views_;
  std::vector<float> prior_;  // a direction's, of the voxels that any view sees
  std::vector<Shares> open_;  // prior times the probability that no view taken measures it
  std::vector<std::size_t> taken_;
};

}  // namespace vantage
