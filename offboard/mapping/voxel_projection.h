#pragma once

#include <array>
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

using ClassifyVoxels = void (*)(const VoxelProjection& projection, VoxelVerdicts* verdicts);

/// All give the same verdicts to the bit.
void classify_voxels_portable(const VoxelProjection& projection, VoxelVerdicts* verdicts);
void classify_voxels_avx2(const VoxelProjection& projection, VoxelVerdicts* verdicts);
void classify_voxels_avx512(const VoxelProjection& projection, VoxelVerdicts* verdicts);

/// The fastest that this machine runs.
ClassifyVoxels best_classify_voxels();

}  // namespace vantage
