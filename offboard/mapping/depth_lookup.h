#pragma once

#include <array>
#include <vector>

#include "lcmtypes/link/depth_map.h"
#include "offboard/mapping/sensor_model.h"
#include "offboard/mapping/voxel_projection.h"

namespace vantage {

/// A depth image made ready for questions that voxels and bricks ask of it.
///
/// Only pixels in state kConverged say anything. Images are row-major floats, metres along the camera's z axis, with
/// one element more than pixels, which answers as a pixel that says nothing.
class DepthLookup {
 public:
  /// Largest half width, pixels, of a voxel's footprint that is searched.
  static constexpr int kMaxHalfWidth = 15;

  /// Makes ready for a depth map. One object serves many in turn and keeps its storage.
  void prepare(const DepthMap& depth_map, const SensorModel& model);

  /// Depth up to which each pixel's ray is known to be free: the surface less a margin of the model's sigmas, at most
  /// the maximum range; 0 where the pixel says nothing.
  const std::vector<float>& free_limit() const { return windows_[0]; }

  /// Largest free limit of the (2 h + 1)^2 pixels around each pixel (clipped to the image): a voxel whose projection
  /// covers them is passed by a ray if its depth is less. h is the largest of 0, 1, 2, 3, 4, 6, 8, 11, 15 that is not
  /// more than `half_width`. Computed when first asked for.
  const std::vector<float>& free_limit_in_window(int half_width);

  /// Depth of the surface each pixel sees; +infinity where it says nothing or the surface is out of range.
  const std::vector<float>& surface() const { return surface_; }

  /// Smallest free limit (0 if a pixel says nothing) and largest depth of interest (-infinity if none says
  /// anything) over a rectangle of pixels, ends included. Conservative: the rectangle may be enlarged.
  /// The rectangle must meet the image; it is clipped to it.
  struct Bounds {
    float min_free, max_reach;
  };
  Bounds bounds(int u_min, int u_max, int v_min, int v_max) const;

 private:
  struct PyramidLevel {
    int width = 0, height = 0;
    std::vector<Bounds> blocks;
  };

  void build_pyramid();

  ProjectionKernels kernels_ = best_projection_kernels();
  int width_ = 0, height_ = 0;
  std::array<std::vector<float>, 9> windows_;  // by half width
  std::size_t windows_ready_ = 0;
  std::vector<float> rows_;  // scratch
  std::vector<float> surface_;
  std::vector<PyramidLevel> pyramid_;  // level k: blocks of 2^(k + kFirstLevel) pixels
};

}  // namespace vantage
