#include "offboard/mapping/voxel_projection.h"

namespace vantage {

ProjectionKernels best_projection_kernels() {
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512vl")) {
    return projection_kernels_avx512();
  }
  if (__builtin_cpu_supports("avx2")) return projection_kernels_avx2();
#endif
  return projection_kernels_portable();
}

}  // namespace vantage
