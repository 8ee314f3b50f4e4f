#pragma once

#include <vector>

#include "onboard/tracking/similarity.h"

namespace vantage::tracking {

struct PoseGraphNode {
  Similarity S_camera_world;
  bool fixed = false;
};

/// What two nodes should be to each other: S_a_world * S_b_world^-1.
struct PoseGraphEdge {
  int a = 0, b = 0;
  Similarity S_a_b;
  double weight = 1;  ///< inverse variance, relative to the other edges
};

/// Poses and what is known of their differences; a loop's edge contradicts the chain of the others by the drift.
struct PoseGraph {
  std::vector<PoseGraphNode> nodes;
  std::vector<PoseGraphEdge> edges;
};

/// Moves the nodes so that the edges are met with least squares (Strasdat et al. 2010: drift of scale is spread over
/// the loop as well when `with_scale`). At least one node must be fixed. False when it can't be solved; the nodes then
/// stay.
bool optimise(PoseGraph* graph, bool with_scale, int iterations = 30);

}  // namespace vantage::tracking
