#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "calib/files/ply.h"
#include "offboard/mapping/brick_pool.h"
#include "offboard/mapping/region.h"

namespace vantage {

struct TsdfOptions {
  double truncation_voxels = 4;  ///< half width of the band kept around surfaces
  /// Four pixels around a projection whose depths differ by more than this share of the truncation distance lie on two
  /// surfaces and say nothing.
  double jump_share = 0.5;

  /// False, with the reason in `why`: a truncation under 2 voxels or over 16, a share not in (0, 1].
  bool valid(std::string* why = nullptr) const;
};

/// Truncated signed distance to the surface, beside the occupancy: where an occupancy shell is off by most of a voxel,
/// its zero is off by less than a tenth (Curless and Levoy, "A volumetric method for building complex models from range
/// images", 1996).
///
/// Distances are in metres along the measuring ray, positive on the sensor's side, averaged with weights that fall with
/// the pixel's variance. Stored in bricks of 8 x 8 x 8 voxels, allocated where a surface passed.
class Tsdf {
 public:
  struct Brick {
    std::array<float, 512> distance{};  ///< m
    std::array<float, 512> weight{};    ///< 0: never measured
  };

  /// \throws std::invalid_argument when the region or the options are not valid.
  explicit Tsdf(const Region& region, const TsdfOptions& options = {});

  const Region& region() const { return region_; }
  double truncation_m() const { return truncation_m_; }
  double jump_m() const { return truncation_m_ * options_.jump_share; }

  /// False when the voxel was never measured or lies outside the region; else its distance, m.
  bool distance_at(const Eigen::Vector3i& voxel, float* distance_m) const;

  /// The brick's storage, null when it has none. Bricks are numbered as in OccupancyMap.
  const Brick* find(std::size_t brick) const { return slots_[brick] == kNone ? nullptr : &storage_[slots_[brick]]; }
  Brick* find(std::size_t brick) { return slots_[brick] == kNone ? nullptr : &storage_[slots_[brick]]; }
  Brick& allocate(std::size_t brick);
  /// Forgets the brick.
  void clear(std::size_t brick);
  void clear();
  std::size_t brick_count() const { return slots_.size(); }
  std::size_t memory_bytes() const;

  /// Same region, distances and weights, to the bit.
  bool operator==(const Tsdf& other) const;

 private:
  static constexpr std::uint32_t kNone = 0xffffffff;

  Region region_;
  TsdfOptions options_;
  double truncation_m_;
  Eigen::Vector3i size_bricks_;
  std::vector<std::uint32_t> slots_;
  BrickPool<Brick> storage_;
  std::vector<std::uint32_t> unused_;
};

/// The surface as triangles: marching cubes on the distances' zero. Cells with a voxel that was never measured are left
/// out. Normals point to the sensors' side; triangles turn counter-clockwise seen from there.
PlyModel extract_mesh(const Tsdf& tsdf);

}  // namespace vantage
