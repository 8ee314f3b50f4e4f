#pragma once

#include <vector>

#include <Eigen/Core>

#include "onboard/depth/image_pyramid.h"
#include "onboard/depth/worker_pool.h"

namespace vantage {

/// Up to `most` corners of an image, one a grid cell at the most so that they are spread out: the highest smaller
/// eigenvalue of the structure tensor (Shi and Tomasi, "Good features to track", 1994), where it stands out of the
/// noise. `corners` is cleared; its room is kept.
void find_corners(const ImagePyramid& image, int most, std::vector<Eigen::Vector2f>* corners);

/// Where a small patch of one image is in another.
struct PatchPlace {
  Eigen::Vector2f position = Eigen::Vector2f::Zero();    ///< pixel of the other image
  Eigen::Matrix2f to_key = Eigen::Matrix2f::Identity();  ///< how far to go in the key image for a pixel of the other
  bool found = false;
};

/// Moves each place from its guess to where the other image looks like `key` at the corner, bent as `to_key` says:
/// Gauss-Newton over shift, gain and offset of grey, inverse compositional (Baker and Matthews, 2004), coarse to fine.
/// `found` is false when it does not settle, leaves the image, or the patches do not correlate in the end.
void align_corners(const ImagePyramid& key, const ImagePyramid& other, const std::vector<Eigen::Vector2f>& corners,
                   WorkerPool* pool, std::vector<PatchPlace>* places);

}  // namespace vantage
