#pragma once

#include <array>

#include <Eigen/Core>

#include "onboard/tracking/image_pyramid.h"

namespace vantage::tracking {

/// Side of the patch that is aligned, and of the same with one pixel around it for the gradients.
inline constexpr int kPatch = 8;
inline constexpr int kBorderedPatch = kPatch + 2;

/// Grey values around a feature, row by row; the feature itself lies at (5, 5) of the ten.
using BorderedPatch = std::array<float, std::size_t{kBorderedPatch} * kBorderedPatch>;

struct PatchAlignment {
  bool converged = false;   ///< the last step was under 0.03 px and the patch stayed inside the image
  double correlation = -1;  ///< zero-mean normalised, of the patch and the image at `pixel`
  Eigen::Vector2d pixel{0, 0};
};

/// Finds `patch` in one level of an image, from a start that is at most some pixels away.
///
/// Inverse compositional Gauss-Newton (Baker and Matthews 2004) over place, gain and offset, so that a change of light
/// moves nothing. With `normal` (unit, of this level) only the place along it is sought: an edgelet. `pixel` is of this
/// level. Allocates nothing.
PatchAlignment align_patch(const ImageView& image, const BorderedPatch& patch, const Eigen::Vector2d& start,
                           const Eigen::Vector2d* normal = nullptr, int iterations = 10);

/// The patch of one level around a pixel of it. False, and nothing written, when it reaches beyond the image.
bool cut_patch(const ImageView& image, const Eigen::Vector2d& pixel, BorderedPatch* patch);

/// Samples `image` (a level of the reference) such that the result looks as the current image should:
/// `A_reference_current` maps an offset in pixels of the current level to one in pixels of the reference's level.
/// False when a sample lies outside.
bool warp_patch(const ImageView& image, const Eigen::Vector2d& pixel, const Eigen::Matrix2d& A_reference_current,
                BorderedPatch* patch);

/// Zero-mean normalised correlation of a patch's middle with many places of an image.
class PatchCorrelation {
 public:
  explicit PatchCorrelation(const BorderedPatch& patch);
  /// With the image around an integer pixel, in [-1, 1]; -1 where the patch reaches beyond it or nothing has contrast.
  double at(const ImageView& image, int u, int v) const;

 private:
  std::array<float, std::size_t{kPatch} * kPatch> normalised_;
  bool contrast_;
};

}  // namespace vantage::tracking
