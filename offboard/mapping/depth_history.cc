#include "offboard/mapping/depth_history.h"

#include <algorithm>

namespace vantage {
namespace {

IntegrationResult refused(std::string error) {
  IntegrationResult result;
  result.error = std::move(error);
  return result;
}

}  // namespace

DepthHistory::DepthHistory(const Region& region, const SensorModel& model, const std::optional<TsdfOptions>& tsdf)
    : map_(region, model) {
  if (tsdf) tsdf_.emplace(region, *tsdf);
}

std::vector<DepthHistory::Entry>::iterator DepthHistory::find(std::int64_t id) {
  return std::find_if(entries_.begin(), entries_.end(), [id](const Entry& entry) { return entry.id == id; });
}

IntegrationResult DepthHistory::add(std::int64_t id, DepthMap depth_map) {
  if (find(id) != entries_.end()) return refused("there is a depth map " + std::to_string(id) + " already");
  const IntegrationResult result = integrate_depth_map(depth_map, &map_, tsdf_ ? &*tsdf_ : nullptr, &scratch_);
  if (result.ok) entries_.push_back({id, std::move(depth_map)});
  return result;
}

IntegrationResult DepthHistory::remove(std::int64_t id) {
  const auto entry = find(id);
  if (entry == entries_.end()) return refused("there is no depth map " + std::to_string(id));
  std::vector<std::uint8_t> bricks(map_.brick_count(), 0);
  find_bricks_of(entry->depth_map, &map_, &scratch_, &bricks);
  entries_.erase(entry);
  return rebuild_bricks(bricks);
}

IntegrationResult DepthHistory::correct(std::int64_t id, const Eigen::Isometry3d& T_world_camera) {
  const auto entry = find(id);
  if (entry == entries_.end()) return refused("there is no depth map " + std::to_string(id));
  if (!is_rigid(T_world_camera)) return refused("the pose T_world_camera is not finite or not a rotation");
  std::vector<std::uint8_t> bricks(map_.brick_count(), 0);
  find_bricks_of(entry->depth_map, &map_, &scratch_, &bricks);
  entry->depth_map.T_world_camera = T_world_camera;
  find_bricks_of(entry->depth_map, &map_, &scratch_, &bricks);
  return rebuild_bricks(bricks);
}

IntegrationResult DepthHistory::rebuild_bricks(const std::vector<std::uint8_t>& bricks) {
  map_.next_revision();
  for (std::size_t brick = 0; brick < bricks.size(); ++brick) {
    if (bricks[brick] == 0) continue;
    map_.reset(brick);
    if (tsdf_) tsdf_->clear(brick);
  }
  IntegrationResult total;
  total.ok = true;
  for (const Entry& entry : entries_) {
    const IntegrationResult result =
        integrate_depth_map(entry.depth_map, &map_, tsdf_ ? &*tsdf_ : nullptr, &scratch_, &bricks);
    total.voxels_hit += result.voxels_hit;
    total.voxels_missed += result.voxels_missed;
    total.voxels_marked += result.voxels_marked;
    total.bricks_changed += result.bricks_changed;
  }
  map_.set_has_marks(map_.counts().marked != 0);
  return total;
}

void DepthHistory::rebuild() {
  map_.clear();
  if (tsdf_) tsdf_->clear();
  for (const Entry& entry : entries_) {
    integrate_depth_map(entry.depth_map, &map_, tsdf_ ? &*tsdf_ : nullptr, &scratch_);
  }
}

}  // namespace vantage
