#pragma once

#include <vector>

#include <Eigen/Core>

#include "onboard/tracking/image_pyramid.h"

namespace vantage::tracking {

/// A point worth following: a corner, or an edgelet whose place is known across the edge alone.
struct Corner {
  Eigen::Vector2d pixel{0, 0};  ///< of level 0
  int level = 0;                ///< of the pyramid where it was found
  float score = 0;  ///< smaller eigenvalue of the structure tensor (Shi and Tomasi); of an edgelet: gradient
  bool edgelet = false;
  Eigen::Vector2d normal{1, 0};  ///< unit, across an edgelet's edge
};

struct DetectorOptions {
  int cell_px = 25;        ///< one corner per cell of the grid, of level 0
  int levels = 3;          ///< of the pyramid that are searched, from level 0
  int fast_threshold = 7;  ///< grey levels
  float min_score = 12;    ///< of a corner
  float min_gradient = 8;  ///< of an edgelet, grey levels per px
  bool edgelets = true;    ///< one edgelet in a cell without a corner
  int border_px = 10;      ///< at the corner's own level
  bool valid(std::string* why = nullptr) const;
};

/// Best corner of each cell of a grid over the image: FAST (Rosten and Drummond 2006; OpenCV's) on some levels of the
/// pyramid, ranked by Shi and Tomasi's score; where a cell holds none, its strongest edgelet.
/// `occupied` names level-0 pixels whose cells are passed over. Row by row; the same every time.
std::vector<Corner> detect_corners(const ImagePyramid& image, const std::vector<Eigen::Vector2d>& occupied,
                                   const DetectorOptions& options = {});

/// Smaller eigenvalue of the mean structure tensor over 8 x 8 pixels around a pixel of a level that keeps 6 px from its
/// edges (grey levels squared per px squared).
float shi_tomasi_score(const ImageView& image, int u, int v);

}  // namespace vantage::tracking
