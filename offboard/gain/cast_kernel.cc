#include "offboard/gain/cast_kernel.h"

#include <algorithm>
#include <array>

namespace vantage {
namespace {

constexpr std::array kKernels = {CastKernel::kScalar, CastKernel::kPortable, CastKernel::kAvx2, CastKernel::kAvx512};
constexpr std::array<std::string_view, 4> kNames = {"scalar", "portable", "avx2", "avx512"};

bool available(CastKernel kernel) {
  switch (kernel) {
#if defined(__x86_64__)
    case CastKernel::kAvx2:
      return __builtin_cpu_supports("avx2") != 0;
    case CastKernel::kAvx512:
      return __builtin_cpu_supports("avx512f") != 0 && __builtin_cpu_supports("avx512bw") != 0 &&
             __builtin_cpu_supports("avx512dq") != 0 && __builtin_cpu_supports("avx512vl") != 0;
#else
    case CastKernel::kAvx2:
    case CastKernel::kAvx512:
      return false;
#endif
    default:
      return true;
  }
}

template <CastBlock kCast>
void one_by_one(const FieldView& field, const GridWalk& walk, const RayColumns& rays, const std::size_t* blocks,
                std::size_t count, RaySums* sums) {
  for (std::size_t i = 0; i < count; ++i) sums[i] = kCast(field, walk, rays, blocks[i]);
}

}  // namespace

std::string_view name_of(CastKernel kernel) { return kNames[static_cast<std::size_t>(kernel)]; }

std::optional<CastKernel> parse_kernel(std::string_view name, std::string* why) {
  for (const CastKernel kernel : available_kernels()) {
    if (name == name_of(kernel)) return kernel;
  }
  if (why != nullptr) {
    *why = "no kernel of this machine is called \"" + std::string(name) + "\"; there are";
    for (const CastKernel kernel : available_kernels()) *why += " " + std::string(name_of(kernel));
  }
  return std::nullopt;
}

std::vector<CastKernel> available_kernels() {
  std::vector<CastKernel> kernels;
  std::copy_if(kKernels.begin(), kKernels.end(), std::back_inserter(kernels), available);
  return kernels;
}

CastKernel best_kernel() { return available_kernels().back(); }

CastBlocks cast_function(CastKernel kernel, GainField::Layout layout) {
  const bool flat = layout == GainField::Layout::kFlat;
#if defined(__x86_64__)
  if (kernel == CastKernel::kAvx512) return flat ? one_by_one<cast_flat_avx512> : cast_bricks_avx512;
  if (kernel == CastKernel::kAvx2 && flat) return one_by_one<cast_flat_avx2>;
#endif
  if (!flat) return one_by_one<cast_bricks_scalar>;
  return kernel == CastKernel::kScalar ? one_by_one<cast_flat_scalar> : one_by_one<cast_flat_portable>;
}

}  // namespace vantage
