#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

namespace vantage {

/// Numbers on a grid of voxels, by channel + channels (x + width (y + ...)), within a border of one voxel of zeros.
struct Feature {
  Feature(int channel_count, const Eigen::Vector3i& size_voxels);

  /// First channel of a voxel; -1 and size are the border.
  float* at(int x, int y, int z) { return data.data() + offset(x, y, z); }
  const float* at(int x, int y, int z) const { return data.data() + offset(x, y, z); }

  int channels;
  Eigen::Vector3i size;
  std::vector<float> data;

 private:
  std::size_t offset(int x, int y, int z) const {
    return static_cast<std::size_t>(channels * (x + 1 + (size.x() + 2) * (y + 1 + (size.y() + 2) * (z + 1))));
  }
};

/// Convolution of 3 x 3 x 3 voxels (or of one) with bias, and max(0, ·) after it.
struct Convolution {
  int inputs = 0, outputs = 0;  ///< channels; outputs in multiples of 16
  int edge = 3;                 ///< 3 or 1
  int stride = 1;               ///< 1 or 2: the output has size / stride voxels
  bool clip = true;
  std::vector<float> weights;  ///< output + outputs (input + inputs tap), tap = x + edge (y + edge z)
  std::vector<float> bias;     ///< by output
};

/// \pre in.channels == inputs; sizes divide by the stride. The same numbers to the bit on every machine.
Feature convolve(const Convolution& convolution, const Feature& in);
/// The same by one of the kernels that this machine can run, from 0 on; the last is the fastest.
Feature convolve(const Convolution& convolution, const Feature& in, std::size_t kernel);
std::size_t convolution_kernels();

}  // namespace vantage
