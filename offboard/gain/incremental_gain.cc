#include "offboard/gain/incremental_gain.h"

#include <algorithm>

#include "lcmtypes/link/depth_map.h"
#include "offboard/gain/brick_walk.h"

namespace vantage {

IncrementalGain::IncrementalGain(const OccupancyMap& map, const RayBundle& rays,
                                 std::vector<Eigen::Isometry3d> T_world_cameras, const GainOptions& options)
    : map_(map), evaluator_(rays, options), poses_(std::move(T_world_cameras)), field_(map) {
  const auto cells_at = [&](int log2) {
    std::size_t count = 1;
    for (int a = 0; a < 3; ++a) {
      size_cells_[static_cast<std::size_t>(a)] = (map.size_bricks()[a] + (1 << log2) - 1) >> log2;
      count *= static_cast<std::size_t>(size_cells_[static_cast<std::size_t>(a)]);
    }
    return count;
  };
  while (cells_at(log2_bricks_per_cell_) > 64 * Cells{}.size()) ++log2_bricks_per_cell_;
  sums_.resize(poses_.size() * evaluator_.block_count());
  trace_rays();
}

std::size_t IncrementalGain::cell_of(const std::array<std::int32_t, 3>& brick) const {
  return static_cast<std::size_t>(
      (brick[0] >> log2_bricks_per_cell_) +
      size_cells_[0] * ((brick[1] >> log2_bricks_per_cell_) + size_cells_[1] * (brick[2] >> log2_bricks_per_cell_)));
}

/// The poses stay, so which cells each block passes is worked out once: with the kernels' own integers, to the region's
/// far side, as what ends a ray today may be gone tomorrow.
void IncrementalGain::trace_rays() {
  const std::size_t blocks = evaluator_.block_count();
  passes_.assign(poses_.size() * blocks, Cells{});
  const Eigen::Vector3i size = map_.region().size_voxels;
  for (std::size_t view = 0; view < poses_.size(); ++view) {
    if (!is_rigid(poses_[view])) continue;
    const GridWalk walk = GainEvaluator::walk_of(map_, poses_[view]);
    for (std::size_t block = 0; block < blocks; ++block) {
      RayPacket<kRaysPerBlock> packet;
      prepare_packet(walk, evaluator_.columns(), block * kRaysPerBlock, &packet);
      Cells& cells = passes_[view * blocks + block];
      for (std::size_t lane = 0; lane < kRaysPerBlock; ++lane) {
        if (packet.hits_region[lane] == 0) continue;
        BrickWalker w = BrickWalker::of(packet, lane);
        while (w.voxel[0] >= 0 && w.voxel[1] >= 0 && w.voxel[2] >= 0 && w.voxel[0] < size.x() &&
               w.voxel[1] < size.y() && w.voxel[2] < size.z()) {
          const std::size_t cell = cell_of({w.voxel[0] >> 3, w.voxel[1] >> 3, w.voxel[2] >> 3});
          cells[cell / 64] |= std::uint64_t{1} << (cell % 64);
          leave_cube(&w, OccupancyMap::kBrickEdge);
        }
      }
    }
  }
}

std::vector<ViewGain> IncrementalGain::update() {
  std::vector<std::size_t> changed;
  field_.update(map_, &changed);
  if (!field_.fits()) {
    fresh_ = true;
    recast_share_ = 1;
    return evaluator_.evaluate(map_, field_, poses_);
  }
  std::vector<std::uint8_t> stale(sums_.size(), 1);
  if (!fresh_) {
    Cells cells{};
    for (const std::size_t brick : changed) {
      const Eigen::Vector3i position = map_.brick_position(brick);
      const std::size_t cell = cell_of({position.x(), position.y(), position.z()});
      cells[cell / 64] |= std::uint64_t{1} << (cell % 64);
    }
    for (std::size_t i = 0; i < stale.size(); ++i) {
      std::uint64_t common = 0;
      for (std::size_t word = 0; word < cells.size(); ++word) common |= passes_[i][word] & cells[word];
      stale[i] = common != 0;
    }
  }
  fresh_ = false;
  evaluator_.cast(map_, field_, poses_, stale, sums_);
  const auto recast = static_cast<double>(std::count(stale.begin(), stale.end(), std::uint8_t{1}));
  recast_share_ = stale.empty() ? 0 : recast / static_cast<double>(stale.size());
  std::vector<ViewGain> gains;
  const std::size_t blocks = evaluator_.block_count();
  for (std::size_t view = 0; view < poses_.size(); ++view) {
    gains.push_back(evaluator_.gain_of_blocks(map_, poses_[view], std::span(sums_).subspan(view * blocks, blocks)));
  }
  return gains;
}

}  // namespace vantage
