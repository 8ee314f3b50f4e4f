#include "offboard/gain/gain_evaluator.h"

#include <algorithm>
#include <array>
#include <stdexcept>

#include "lcmtypes/link/depth_map.h"
#include "offboard/gain/parallel_tasks.h"
#include "offboard/gain/reference_gain.h"

namespace vantage {
namespace {

constexpr std::size_t kBlocksPerTask = 64;

const GainOptions& checked(const GainOptions& options) {
  std::string why;
  if (!options.valid(&why)) throw std::invalid_argument(why);
  return options;
}

}  // namespace

GainEvaluator::GainEvaluator(const RayBundle& rays, const GainOptions& options)
    : rays_(rays),
      options_(checked(options)),
      kernel_(options.kernel.empty() ? best_kernel() : *parse_kernel(options.kernel)) {
  const std::vector<Eigen::Vector3d>& directions = rays_.directions();
  const std::size_t padded = (directions.size() + kRaysPerBlock - 1) / kRaysPerBlock * kRaysPerBlock;
  for (std::size_t i = 0; i < padded; ++i) {
    const Eigen::Vector3d& direction = directions[std::min(i, directions.size() - 1)];
    x_.push_back(direction.x());
    y_.push_back(direction.y());
    z_.push_back(direction.z());
  }
}

GridWalk GainEvaluator::walk_of(const OccupancyMap& map, const Eigen::Isometry3d& T_world_camera) {
  GridWalk walk;
  walk.time_scale = GridWalk::time_scale_of(map.region().size_voxels.cast<double>().norm());
  const Eigen::Vector3d origin = map.region().to_voxels(T_world_camera.translation());
  for (int i = 0; i < 3; ++i) {
    walk.size[static_cast<std::size_t>(i)] = map.region().size_voxels[i];
    walk.origin[static_cast<std::size_t>(i)] = origin[i];
    for (int j = 0; j < 3; ++j) walk.rotation[static_cast<std::size_t>(3 * i + j)] = T_world_camera.linear()(i, j);
  }
  return walk;
}

void GainEvaluator::cast(const OccupancyMap& map, const GainField& field,
                         std::span<const Eigen::Isometry3d> T_world_cameras, std::span<const std::uint8_t> stale,
                         std::span<RaySums> sums) const {
  const FieldView field_view = field.view();
  const RayColumns rays = columns();
  const CastBlocks cast_blocks = cast_function(kernel_, field.layout());
  const std::size_t blocks = block_count(), tasks = (blocks + kBlocksPerTask - 1) / kBlocksPerTask;
  run_tasks(tasks * T_world_cameras.size(), options_.threads, [&](std::size_t task) {
    const std::size_t view = task / tasks, first = task % tasks * kBlocksPerTask;
    if (!is_rigid(T_world_cameras[view])) return;
    const GridWalk walk = walk_of(map, T_world_cameras[view]);
    std::array<std::size_t, kBlocksPerTask> wanted;
    std::array<RaySums, kBlocksPerTask> cast;
    std::size_t count = 0;
    for (std::size_t block = first; block < std::min(first + kBlocksPerTask, blocks); ++block) {
      if (stale.empty() || stale[view * blocks + block] != 0) wanted[count++] = block;
    }
    cast_blocks(field_view, walk, rays, wanted.data(), count, cast.data());
    for (std::size_t i = 0; i < count; ++i) sums[view * blocks + wanted[i]] = cast[i];
  });
}

ViewGain GainEvaluator::gain_of_blocks(const OccupancyMap& map, const Eigen::Isometry3d& T_world_camera,
                                       std::span<const RaySums> sums) const {
  if (!is_rigid(T_world_camera)) {
    ViewGain gain;
    gain.reason = "the pose T_world_camera is not finite or not a rotation";
    return gain;
  }
  RaySums total;
  for (const RaySums& block : sums) total += block;
  total.rays = static_cast<std::int64_t>(rays_.size());
  ViewGain gain = gain_of_sums(total, map.mark_step_m(), options_.weights);
  gain.marks_missing = !map.has_marks();
  return gain;
}

std::vector<ViewGain> GainEvaluator::evaluate(const OccupancyMap& map,
                                              std::span<const Eigen::Isometry3d> T_world_cameras) const {
  return evaluate(map, GainField(map, options_.threads), T_world_cameras);
}

std::vector<ViewGain> GainEvaluator::evaluate(const OccupancyMap& map, const GainField& field,
                                              std::span<const Eigen::Isometry3d> T_world_cameras) const {
  std::vector<ViewGain> gains(T_world_cameras.size());
  if (!field.fits()) {
    run_tasks(gains.size(), options_.threads, [&](std::size_t view) {
      const Eigen::Isometry3d& pose = T_world_cameras[view];
      const RaySums sums = is_rigid(pose) ? cast_rays_reference(map, rays_, pose) : RaySums{};
      gains[view] = gain_of_blocks(map, pose, {&sums, 1});
    });
    return gains;
  }
  const std::size_t blocks = block_count();
  std::vector<RaySums> sums(blocks * T_world_cameras.size());
  cast(map, field, T_world_cameras, {}, sums);
  for (std::size_t view = 0; view < gains.size(); ++view) {
    gains[view] = gain_of_blocks(map, T_world_cameras[view], std::span(sums).subspan(view * blocks, blocks));
  }
  return gains;
}

}  // namespace vantage
