#pragma once

#include <vector>

#include "offboard/experiment/experiment_object.h"
#include "offboard/planning/view_space.h"

namespace vantage {

/// A box on the ground, 0.2 x 0.2 x 0.24 m.
inline ExperimentObject box_object() {
  ExperimentObject box{"box", "box.ply", "0123456789abcdef", {}};
  for (int i = 0; i < 8; ++i) {
    box.mesh.points.emplace_back((i & 1) ? 0.1F : -0.1F, (i & 2) ? 0.1F : -0.1F, (i & 4) ? 0.24F : 0.0F);
  }
  box.mesh.triangles = {{0, 1, 3}, {0, 3, 2}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                        {2, 3, 7}, {2, 7, 6}, {0, 2, 6}, {0, 6, 4}, {1, 3, 7}, {1, 7, 5}};
  return box;
}

/// Six of the paper's views, at two azimuths, numbered from 0.
inline std::vector<CandidateView> six_views() {
  std::vector<CandidateView> views;
  for (const CandidateView& view : cylinder_views()) {
    if (view.id % 16 == 0 || view.id % 16 == 6) {
      views.push_back({static_cast<std::int64_t>(views.size()), view.T_world_camera});
    }
  }
  return views;
}

}  // namespace vantage
