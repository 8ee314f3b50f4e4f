#pragma once

#include <cstddef>

namespace vantage::convolution_kernel {

constexpr int kGroup = 16;  ///< outputs that are summed together

/// One row of output voxels for one group of outputs. Nothing here but numbers: these files are compiled for several
/// instruction sets, and no inline function of others may come out of them.
struct Row {
  const float* in;             ///< first input of the first voxel's middle tap
  std::ptrdiff_t in_step[3];   ///< between taps along x, y, z
  std::ptrdiff_t in_next;      ///< to the next output voxel's
  int inputs, reach;           ///< reach: 1 for 3 x 3 x 3 taps, 0 for one
  const float* weights;        ///< of the group, first tap, first input
  std::ptrdiff_t weight_step;  ///< to the next input's or tap's
  const float* bias;           ///< of the group
  bool clip;
  float* out;  ///< of the group, first voxel
  std::ptrdiff_t out_next;
  int voxels;
};

void portable(const Row& row);
void avx2(const Row& row);
void avx512(const Row& row);

}  // namespace vantage::convolution_kernel
