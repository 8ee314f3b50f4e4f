#include "offboard/lookahead/convolution.h"

#include "offboard/lookahead/convolution_kernel.h"

namespace vantage {
namespace {

using Kernel = void (*)(const convolution_kernel::Row& row);

/// Those that this machine can run, slowest first.
const std::vector<Kernel>& kernels() {
  static const std::vector<Kernel> kKernels = [] {
    std::vector<Kernel> found{convolution_kernel::portable};
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx2") != 0) found.push_back(convolution_kernel::avx2);
    if (__builtin_cpu_supports("avx512f") != 0) found.push_back(convolution_kernel::avx512);
#endif
    return found;
  }();
  return kKernels;
}

}  // namespace

Feature::Feature(int channel_count, const Eigen::Vector3i& size_voxels)
    : channels(channel_count),
      size(size_voxels),
      data(static_cast<std::size_t>(channel_count) *
           static_cast<std::size_t>((size_voxels + Eigen::Vector3i::Constant(2)).prod())) {}

std::size_t convolution_kernels() { return kernels().size(); }

Feature convolve(const Convolution& convolution, const Feature& in) {
  return convolve(convolution, in, convolution_kernels() - 1);
}

Feature convolve(const Convolution& convolution, const Feature& in, std::size_t kernel) {
  const Kernel sum = kernels().at(kernel);
  const int stride = convolution.stride;
  Feature out(convolution.outputs, in.size / stride);
  convolution_kernel::Row row{};
  row.in_step[0] = in.at(1, 0, 0) - in.at(0, 0, 0);
  row.in_step[1] = in.at(0, 1, 0) - in.at(0, 0, 0);
  row.in_step[2] = in.at(0, 0, 1) - in.at(0, 0, 0);
  row.in_next = stride * row.in_step[0];
  row.inputs = convolution.inputs;
  row.reach = convolution.edge / 2;
  row.weight_step = convolution.outputs;
  row.clip = convolution.clip;
  row.out_next = convolution.outputs;
  row.voxels = out.size.x();
  for (int group = 0; group < convolution.outputs; group += convolution_kernel::kGroup) {
    row.weights = convolution.weights.data() + group;
    row.bias = convolution.bias.data() + group;
    for (int z = 0; z < out.size.z(); ++z) {
      for (int y = 0; y < out.size.y(); ++y) {
        row.in = in.at(0, stride * y, stride * z);
        row.out = out.at(0, y, z) + group;
        sum(row);
      }
    }
  }
  return out;
}

}  // namespace vantage
