#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Geometry>

#include "calib/camera_model.h"
#include "offboard/mapping/occupancy_map.h"
#include "offboard/planning/view_space.h"

namespace vantage {

/// What a map knows of the object that the views face: a box of voxels that stands on the ground, with some numbers for
/// each, as SurfaceNetwork reads them.
class MapWindow {
 public:
  static constexpr int kWidth = 48, kHeight = 40;  ///< voxels along x and y, along z
  static constexpr std::size_t kVoxels = std::size_t{kWidth} * kWidth * kHeight;

  /// Each 0 to 127, directions -127 to 127.
  enum Channel : std::uint8_t {
    kFree,
    kOccupied,
    kProbability,                   ///< P_o; 64 when unobserved
    kBehind,                        ///< the nearer behind a seen surface (Eq. 9), the more; 0: not behind one
    kAboveGround,                   ///< the voxel's layer over kHeight
    kLookedAt,                      ///< by how many of the views taken no occupied voxel hides it: 8 or more are 127
    kLookedFrom,                    ///< x, y, z: mean direction to these
    kHiddenFrom = kLookedFrom + 3,  ///< x, y, z: sum of the directions to the others, over the number of all views
    kViews = kHiddenFrom + 3,       ///< taken: 16 or more are 127
    kChannels
  };
  using Numbers = std::array<std::int8_t, kChannels>;

  /// `views`: poses (T_world_camera) from which the map was measured. `foot`: world, m, on
  /// the ground, below the window's middle.
  MapWindow(const OccupancyMap& map, const CameraModel& camera, std::span<const Eigen::Isometry3d> views,
            const Eigen::Vector3d& foot);

  /// By voxel x + kWidth (y + kWidth z) of the window; outside the map's region all 0.
  const std::vector<Numbers>& numbers() const { return numbers_; }
  /// The window's first voxel, in voxels of the map's region; may lie outside.
  const Eigen::Vector3i& min_corner() const { return min_; }

 private:
  std::vector<Numbers> numbers_;
  Eigen::Vector3i min_;
};

/// The point nearest to the lines along which the views look (least squares), world, m; `otherwise` when they are
/// parallel or there are none.
Eigen::Vector3d focus_of(std::span<const CandidateView> views, const Eigen::Vector3d& otherwise);

}  // namespace vantage
