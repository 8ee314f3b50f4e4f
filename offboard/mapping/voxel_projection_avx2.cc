#include "offboard/mapping/voxel_projection_body.h"

namespace vantage {

void classify_voxels_avx2(const VoxelProjection& projection, VoxelVerdicts* verdicts) {
  classify(projection, verdicts);
}

}  // namespace vantage
