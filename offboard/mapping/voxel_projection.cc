#include "offboard/mapping/voxel_projection.h"

namespace vantage {

ClassifyVoxels best_classify_voxels() {
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512vl")) {
    return classify_voxels_avx512;
  }
  if (__builtin_cpu_supports("avx2")) return classify_voxels_avx2;
#endif
  return classify_voxels_portable;
}

}  // namespace vantage
