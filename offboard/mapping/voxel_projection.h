#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace vantage {

/// A brick's voxels against a depth image. Plain numbers, so that files compiled for other instruction sets share no
/// inline code with the rest of the program.
struct VoxelProjection {
  /// Camera coordinates (m) of the first voxel's centre, and of a step of one voxel along x, y, z.
  std::array<float, 3> first{}, step_x{}, step_y{}, step_z{};
  float fx = 0, fy = 0, cx = 0, cy = 0;  ///< pixel = truncate(f x / z + c): c holds the half pixel
  int width = 0, height = 0;
  float margin = 0;  ///< pixels: half width of a voxel's footprint, by which its centre may lie beside the image
  /// Images of DepthLookup; element width x height answers for every voxel off the image (0 and infinity).
  const float* free_limit = nullptr;
  const float* surface = nullptr;
  float occlusion_range_m = 0, marks_per_metre = 0;
};

/// What the image says of a brick's 512 voxels, in storage order: seen through (1) or not (0), and the occlusion mark
/// (0: none); never both.
struct VoxelVerdicts {
  alignas(64) std::array<std::uint8_t, 512> missed;
  alignas(64) std::array<std::uint8_t, 512> mark;
  std::int32_t missed_count, mark_count;
};

/// A row of a depth image as DepthLookup keeps it.
struct DepthRow {
  const float *depth_m = nullptr, *sigma_m = nullptr;
  const std::uint8_t* state = nullptr;  ///< DepthState
  const float* x_squared = nullptr;     ///< (x / z)^2 by column
  float one_plus_y_squared = 1, max_range_m = 0, margin_sigmas = 0;
  float *free_limit = nullptr, *surface = nullptr;  ///< out
  std::size_t width = 0;
};

/// Loops over voxels and pixels, compiled once an instruction set. All give the same results to the bit.
struct ProjectionKernels {
  void (*classify_voxels)(const VoxelProjection& projection, VoxelVerdicts* verdicts);
  void (*prepare_row)(const DepthRow& row);
  /// out[i] = max(a[i], b[i], c[i]).
  void (*max_of_three)(const float* a, const float* b, const float* c, std::size_t n, float* out);
};

ProjectionKernels projection_kernels_portable();
ProjectionKernels projection_kernels_avx2();
ProjectionKernels projection_kernels_avx512();

/// The fastest that this machine runs.
ProjectionKernels best_projection_kernels();

}  // namespace vantage
