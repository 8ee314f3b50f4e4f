#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "lcmtypes/link/depth_map.h"
#include "offboard/mapping/brick_pool.h"
#include "offboard/mapping/log_odds_levels.h"
#include "offboard/mapping/region.h"
#include "offboard/mapping/sensor_model.h"

namespace vantage {

struct IntegrationScratch;
class Tsdf;

/// What an integration did, or why it did nothing.
struct IntegrationResult {
  bool ok = false;
  std::string error;                ///< the reason, when not ok; the map is then unchanged
  std::int64_t voxels_hit = 0;      ///< voxels that hold a measured point
  std::int64_t voxels_missed = 0;   ///< voxels seen through
  std::int64_t voxels_marked = 0;   ///< voxels behind a surface whose occlusion distance was set or lessened
  std::int64_t bricks_changed = 0;  ///< bricks of which a voxel changed
};

/// Voxels of the region by state, and those that carry an occlusion mark.
struct VoxelCounts {
  std::int64_t unobserved = 0, free = 0, uncertain = 0, occupied = 0, marked = 0;
};

/// Volumetric occupancy map over a bounded region.
///
/// Each voxel has a log-odds value, a flag that tells an unobserved voxel from one at log-odds 0, and the smallest
/// distance behind a measured surface d(x) (Eq. 9), kept in 254 steps of the sensor model's d_max. Storage is bricks of
/// 8 x 8 x 8 voxels; a brick whose voxels are all alike and without marks takes no storage of its own, so memory grows
/// with the surface and the unfinished space around it, not with the region.
///
///     OccupancyMap map(Region{}, SensorModel{});
///     const IntegrationResult result = map.integrate(depth_map);
///     if (!result.ok) log(result.error);
///
/// Not synchronised: one thread writes, or any number read.
class OccupancyMap {
 public:
  static constexpr int kBrickEdge = 8;
  static constexpr int kBrickVoxels = kBrickEdge * kBrickEdge * kBrickEdge;
  /// Occlusion marks: 0 none, k in [1, 255] the distance (k - 1) occlusion_range_m / 254.
  static constexpr int kMarkSteps = 254;

  /// Voxel (x, y, z) of the brick is element x + 8 y + 64 z.
  struct Brick {
    std::array<Level, kBrickVoxels> level{};
    std::array<std::uint8_t, kBrickVoxels> mark{};
  };

  /// \throws std::invalid_argument with the reason when the region or the model is not valid.
  explicit OccupancyMap(const Region& region = {}, const SensorModel& model = {});

  const Region& region() const { return region_; }
  const SensorModel& sensor_model() const { return model_; }

  // Queries. A voxel must lie in the region.

  bool observed(const Eigen::Vector3i& voxel) const { return level(voxel) != kUnobservedLevel; }
  float log_odds(const Eigen::Vector3i& voxel) const { return levels_.log_odds(level(voxel)); }
  double probability(const Eigen::Vector3i& voxel) const { return levels_.probability(level(voxel)); }
  VoxelState state(const Eigen::Vector3i& voxel) const { return levels_.state(level(voxel)); }
  bool has_mark(const Eigen::Vector3i& voxel) const { return mark(voxel) != 0; }
  /// Smallest distance behind a measured surface, m; infinity when the voxel carries no mark.
  double occlusion_distance_m(const Eigen::Vector3i& voxel) const;
  /// State of the voxel at a point of the world; unobserved outside the region.
  VoxelState state_at(const Eigen::Vector3d& point) const;

  VoxelCounts counts() const;
  /// Voxels of the region by level.
  std::vector<std::int64_t> level_counts() const;
  /// Sum of the voxels' entropies over the region (Eq. 15), nats; an unobserved voxel has ln 2.
  double entropy_nats() const;
  /// Centres of the occupied voxels, world, m; ordered by brick, then by x, y, z within it.
  std::vector<Eigen::Vector3d> occupied_centers() const;
  /// Calls `visit(const Eigen::Vector3i& voxel)` for every occupied voxel, in the same order.
  template <typename Visit>
  void for_each_occupied(Visit&& visit) const;

  /// True when a mark was ever set: without marks Eq. 9 and the occplane voxels of Eq. 18 have nothing to count.
  bool has_marks() const { return has_marks_; }
  void set_has_marks(bool has_marks) { has_marks_ = has_marks; }

  /// Bytes held, the bricks' storage and index included.
  std::size_t memory_bytes() const;

  /// Same region, sensor model, log-odds, observed flags and marks, voxel by voxel.
  bool operator==(const OccupancyMap& other) const;

  // Updates.

  /// Voxel-projective integration of a depth image (depth_integrator.h); into a TSDF of the same region too, if given.
  IntegrationResult integrate(const DepthMap& depth_map, Tsdf* tsdf = nullptr);

  /// Exact ray walk from a sensor's origin to every point (world, m), as OctoMap's insertPointCloud does with
  /// discretize off: a voxel is updated once a cloud, and an end point wins over a passing ray. Points beyond max_range
  /// free the ray up to there. Marks the voxels behind the end points up to d_max. Refuses a NaN or infinite number.
  IntegrationResult integrate_points(const Eigen::Vector3d& origin, const std::vector<Eigen::Vector3d>& points);

  /// Sets an observed voxel's log-odds, to the bit. False when the value is not finite or there are too many distinct
  /// values (LogOddsLevels::kMaxLevels).
  bool set_log_odds(const Eigen::Vector3i& voxel, float log_odds);
  /// Makes the voxel unobserved; its mark stays.
  void set_unobserved(const Eigen::Vector3i& voxel);
  /// Sets the voxel's mark to the nearest step of `distance_m`; a negative number removes it, one beyond d_max too.
  void set_occlusion_distance(const Eigen::Vector3i& voxel, double distance_m);
  /// Forgets everything.
  void clear();

  // Access by brick, for integrators, files and the gain's encoding.

  Eigen::Vector3i size_bricks() const { return size_bricks_; }
  std::size_t brick_count() const { return slots_.size(); }
  std::size_t brick_index(const Eigen::Vector3i& brick) const {
    return static_cast<std::size_t>(brick.x()) +
           static_cast<std::size_t>(size_bricks_.x()) *
               (static_cast<std::size_t>(brick.y()) +
                static_cast<std::size_t>(size_bricks_.y()) * static_cast<std::size_t>(brick.z()));
  }
  Eigen::Vector3i brick_position(std::size_t brick) const;
  /// Voxels of the brick inside the region, (8, 8, 8) but at the region's far faces.
  Eigen::Vector3i brick_extent(const Eigen::Vector3i& brick) const {
    return (region_.size_voxels - kBrickEdge * brick).cwiseMin(kBrickEdge);
  }
  /// The brick's voxels, or null when all are at `uniform_level(brick)` and without marks.
  const Brick* dense(std::size_t brick) const {
    return slots_[brick].storage == kUniform ? nullptr : &storage_[slots_[brick].storage];
  }
  Level uniform_level(std::size_t brick) const { return slots_[brick].level; }
  void set_uniform_level(std::size_t brick, Level level) { slots_[brick].level = level; }
  /// Storage for the brick's voxels, filled with what it holds. Close it when done.
  Brick& open(std::size_t brick);
  /// Gives the storage back when the brick's voxels are all alike. `changed`: note the brick in `changed_since`.
  void close(std::size_t brick, bool changed);
  /// Makes the brick's voxels unobserved and takes their marks.
  void reset(std::size_t brick);
  /// Counts up; changes closed from now on belong to the new revision. Returns it.
  std::uint32_t next_revision() { return ++revision_; }
  std::uint32_t revision() const { return revision_; }
  std::uint32_t brick_revision(std::size_t brick) const { return slots_[brick].revision; }
  void touch(std::size_t brick) { slots_[brick].revision = revision_; }

  LogOddsLevels& levels() { return levels_; }
  const LogOddsLevels& levels() const { return levels_; }

  Level level(const Eigen::Vector3i& voxel) const {
    const std::size_t brick = brick_index(voxel / kBrickEdge);
    const Brick* voxels = dense(brick);
    return voxels == nullptr ? uniform_level(brick) : voxels->level[index_in_brick(voxel)];
  }
  std::uint8_t mark(const Eigen::Vector3i& voxel) const {
    const Brick* voxels = dense(brick_index(voxel / kBrickEdge));
    return voxels == nullptr ? std::uint8_t{0} : voxels->mark[index_in_brick(voxel)];
  }
  /// Mark of a distance in [0, d_max], m.
  std::uint8_t mark_of_distance(double distance_m) const {
    return static_cast<std::uint8_t>(1.5 + distance_m / mark_step_m());
  }
  double mark_step_m() const { return model_.occlusion_range_m / kMarkSteps; }

  static std::size_t index_in_brick(const Eigen::Vector3i& voxel) {
    return static_cast<std::size_t>((voxel.x() & 7) | (voxel.y() & 7) << 3 | (voxel.z() & 7) << 6);
  }

 private:
  static constexpr std::uint32_t kUniform = 0xffffffff;

  /// What integrate() keeps between images. A copy of a map starts without.
  struct Scratch {
    std::unique_ptr<IntegrationScratch> held;
    Scratch();
    ~Scratch();
    Scratch(const Scratch& /*other*/) : Scratch() {}
    Scratch(Scratch&& /*other*/) noexcept : Scratch() {}
    Scratch& operator=(const Scratch& /*other*/) { return *this; }
    Scratch& operator=(Scratch&& /*other*/) noexcept { return *this; }
  };

  struct Slot {
    std::uint32_t storage = kUniform;
    std::uint32_t revision = 0;
    Level level = kUnobservedLevel;
  };

  Region region_;
  SensorModel model_;
  Eigen::Vector3i size_bricks_;
  LogOddsLevels levels_;
  std::vector<Slot> slots_;
  BrickPool<Brick> storage_;
  std::vector<std::uint32_t> unused_;  // elements of storage_ given back
  std::uint32_t revision_ = 0;
  bool has_marks_ = false;
  Scratch scratch_;
};

template <typename Visit>
void OccupancyMap::for_each_occupied(Visit&& visit) const {
  for (std::size_t b = 0; b < brick_count(); ++b) {
    const Brick* voxels = dense(b);
    if (voxels == nullptr && levels_.state(uniform_level(b)) != VoxelState::kOccupied) continue;
    const Eigen::Vector3i position = brick_position(b), extent = brick_extent(position);
    for (int z = 0; z < extent.z(); ++z) {
      for (int y = 0; y < extent.y(); ++y) {
        for (int x = 0; x < extent.x(); ++x) {
          const auto i = static_cast<std::size_t>(x | y << 3 | z << 6);
          if (levels_.state(voxels == nullptr ? uniform_level(b) : voxels->level[i]) != VoxelState::kOccupied) continue;
          visit(Eigen::Vector3i(kBrickEdge * position + Eigen::Vector3i(x, y, z)));
        }
      }
    }
  }
}

}  // namespace vantage
