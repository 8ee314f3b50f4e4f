#pragma once

#include <filesystem>
#include <memory>
#include <optional>

#include "offboard/mapping/occupancy_map.h"

namespace octomap {
class OcTree;
}

namespace vantage {

/// The map as an OctoMap: a leaf for every observed voxel with its log-odds to the bit, none for an unobserved one;
/// alike neighbours are pruned. Marks have no place in it.
/// \throws std::invalid_argument when the region is not on OctoMap's grid (Region::aligned).
std::unique_ptr<octomap::OcTree> to_octree(const OccupancyMap& map);

/// An OctoMap as a map: leaves keep their log-odds to the bit, coarse leaves are spread over their voxels.
/// `region` must have the tree's resolution and grid; without it, the smallest box that holds the tree's leaves (one
/// voxel for an empty tree). Leaves outside the region are left out. Marks are absent (`has_marks()` is false).
/// \throws InputError when the tree does not fit: resolution, grid, a box beyond Region::kMaxSizeVoxels, a value that
/// is not finite.
OccupancyMap from_octree(const octomap::OcTree& tree, const std::optional<Region>& region = {},
                         const SensorModel& model = {});

/// Writes `.ot` (all of it) or `.bt` (OctoMap's binary maps: occupied or free alone, at the clamps), by the name's end.
///
/// An .ot of ours is an OctoMap file that any reader of OctoMap opens, followed by a section of our own with the
/// region, the sensor model and the occlusion marks, so that reading it back gives an equal map. The section ends the
/// file; see docs/mapping.md. \throws InputError when the file can't be written or the name has another end.
void write_map(const std::filesystem::path& path, const OccupancyMap& map);

/// Reads what write_map writes, and any other .ot or .bt of an OcTree. `region` and `model` are for foreign files (and
/// .bt); ours carry their own, and a region that differs from the file's own is refused.
/// \throws InputError that names the file and the fault: not an OctoMap, another kind of tree, cut short, damaged.
OccupancyMap read_map(const std::filesystem::path& path, const std::optional<Region>& region = {},
                      const SensorModel& model = {});

}  // namespace vantage
