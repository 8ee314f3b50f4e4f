#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "lcmtypes/link/depth_map.h"
#include "offboard/mapping/depth_lookup.h"
#include "offboard/mapping/occupancy_map.h"
#include "offboard/mapping/tsdf.h"

namespace vantage {

/// Measured points by voxel of a brick: 0 none, else 1 + the VoxelUpdate.
using HitMask = std::array<std::uint8_t, OccupancyMap::kBrickVoxels>;

/// Storage that one integration leaves to the next.
struct IntegrationScratch {
  DepthLookup lookup;
  std::vector<std::uint32_t> hits_of_brick;  // 1 + element of hits; 0: none
  std::vector<HitMask> hits;
};

/// Voxel-projective integration of a depth image: every voxel in the frustum asks the image, not every ray the voxels.
///
/// A voxel is updated at most once an image, by the first rule that holds:
///  1. hit: it holds a measured point within range. Full log-odds where the smallest sigma of its points is at most
///  half
///     a voxel (two thirds of the belief then lie in it), half up to one voxel, a quarter up to two, beyond none.
///  2. miss: a pixel of its footprint sees through it: the largest free limit (surface less `free_margin_sigmas` sigma,
///     cut at the maximum range) of the pixels under the voxel's inscribed sphere lies behind the voxel's centre.
///  3. mark: the surface at its centre's pixel lies before it, and the farthest in its footprint by at most d_max along
///     the ray: d(x) becomes the smaller of what it was and that distance (Eq. 9). Known voxels are marked too, so that
///     marks do not depend on the order of images; the gain reads the mark of unknown ones alone.
///
/// Only pixels in state kConverged speak. An edge pixel may belong to either side, so it neither hits, nor frees (it
/// might free the near side's rim), nor marks; a pixel that did not converge says nothing of the space before it.
///
/// The pyramid of the image's extremes settles whole bricks: all seen through (one update for a uniform brick), or all
/// out of reach. Both answers equal the voxel by voxel ones.
///
/// `scratch` keeps its storage from one image to the next. `only`, when given, has an entry for every brick of the map:
/// bricks at 0 stay as they are. Refuses what DepthMap::valid refuses, the map unchanged.
IntegrationResult integrate_depth_map(const DepthMap& depth_map, OccupancyMap* map, Tsdf* tsdf,
                                      IntegrationScratch* scratch, const std::vector<std::uint8_t>* only = nullptr);

/// Notes in `bricks` (an element a brick, set to 1) every brick that integrating the depth map, which must be valid,
/// can change in the map or in a TSDF beside it. Changes nothing else.
void find_bricks_of(const DepthMap& depth_map, OccupancyMap* map, IntegrationScratch* scratch,
                    std::vector<std::uint8_t>* bricks);

}  // namespace vantage
