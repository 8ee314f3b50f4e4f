#include "offboard/mapping/voxel_projection_body.h"

namespace vantage {

ProjectionKernels projection_kernels_avx512() { return {classify, prepare_row, max_of_three}; }

}  // namespace vantage
