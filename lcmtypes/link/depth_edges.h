#pragma once

#include "lcmtypes/link/depth_map.h"

namespace vantage {

/// What makes a step of depth an edge. In inverse depth, where a plane has the same slope everywhere and a disparity is
/// proportional to it.
struct DepthEdgeOptions {
  double jump_per_m = 0.035;   ///< 1/m: a step beyond the slope of a surface that counts (35 mm at 1 m)
  double slope_per_m = 0.011;  ///< 1/m per pixel: the steepest surface; bridges holes between two measured pixels
  int radius_px = 3;           ///< pixels around an edge that may carry the other side's depth
};

/// Makes kEdge of every kConverged pixel within the radius (a square) of a depth edge: there a sensor's window, or a
/// mixed pixel, may have taken the depth of the other side. Edges are looked for along rows and columns between
/// neighbouring measured pixels, across holes too.
void mark_depth_edges(DepthMap* map, const DepthEdgeOptions& options);

}  // namespace vantage
