#include "offboard/mapping/depth_integrator.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>
#include <optional>

#include "offboard/mapping/tsdf_integrator.h"
#include "offboard/mapping/voxel_projection.h"

namespace vantage {
namespace {

constexpr int kEdge = OccupancyMap::kBrickEdge;
constexpr int kGroup = 4;          // bricks an edge: the first, coarse question
constexpr float kNearest = 1e-4F;  // m; voxel centres nearer the camera's plane project nowhere useful

/// A cube's outline reaches from its centre, in the mean over directions, so many half edges far.
constexpr float kSilhouette = 1.4F;
constexpr float kMaxMargin = kSilhouette * DepthLookup::kMaxHalfWidth;  // pixels

/// Full, half or quarter hit by a pixel's sigma against the voxel's edge; 0: too vague to hit a voxel.
std::uint8_t hit_kind(double sigma_voxels) {
  if (sigma_voxels <= 0.5) return static_cast<std::uint8_t>(VoxelUpdate::kHit) + 1;
  if (sigma_voxels <= 1) return static_cast<std::uint8_t>(VoxelUpdate::kHalfHit) + 1;
  if (sigma_voxels <= 2) return static_cast<std::uint8_t>(VoxelUpdate::kQuarterHit) + 1;
  return 0;
}

/// Asks for a brick's storage, which lies in memory far away as often as not; it comes while the image is asked.
void prefetch(const OccupancyMap::Brick* brick) {
  if (brick == nullptr) return;
  constexpr std::size_t kCacheLine = 64;
  const auto* bytes = reinterpret_cast<const char*>(brick);
  for (std::size_t at = 0; at < sizeof *brick; at += kCacheLine) __builtin_prefetch(bytes + at);
}

class DepthIntegration {
 public:
  DepthIntegration(const DepthMap& depth_map, OccupancyMap* map, Tsdf* tsdf, IntegrationScratch* scratch,
                   const std::vector<std::uint8_t>* only)
      : depth_map_(depth_map),
        map_(*map),
        only_(only),
        lookup_(scratch->lookup),
        hits_of_brick_(scratch->hits_of_brick),
        hits_(scratch->hits),
        fx_(static_cast<float>(depth_map.camera.fx)),
        fy_(static_cast<float>(depth_map.camera.fy)),
        // Half a pixel is added once, so that truncation rounds.
        cx_(static_cast<float>(depth_map.camera.cx + 0.5)),
        cy_(static_cast<float>(depth_map.camera.cy + 0.5)),
        resolution_(static_cast<float>(map->region().resolution_m)),
        occlusion_range_(static_cast<float>(map->sensor_model().occlusion_range_m)) {
    const Eigen::Isometry3d T_camera_world = depth_map.T_world_camera.inverse();
    axes_ = (T_camera_world.linear() * map->region().resolution_m).cast<float>();
    // Centre of the region's first voxel, camera frame.
    origin_ = T_camera_world * map->region().center(Eigen::Vector3i::Zero());
    columns_ = T_camera_world.linear() * map->region().resolution_m;
    lookup_.prepare(depth_map, map->sensor_model());
    if (tsdf != nullptr) {
      tsdf_ = tsdf;
      tsdf_integrator_.emplace(depth_map, lookup_.surface(), tsdf);
      truncation_ = static_cast<float>(tsdf->truncation_m());
    }
    projection_.fx = fx_;
    projection_.fy = fy_;
    projection_.cx = cx_;
    projection_.cy = cy_;
    projection_.width = depth_map.camera.width;
    projection_.height = depth_map.camera.height;
    projection_.surface = lookup_.surface().data();
    projection_.occlusion_range_m = occlusion_range_;
    projection_.marks_per_metre = static_cast<float>(1 / map->mark_step_m());
    for (int i = 0; i < 3; ++i) {
      projection_.step_x[static_cast<std::size_t>(i)] = axes_(i, 0);
      projection_.step_y[static_cast<std::size_t>(i)] = axes_(i, 1);
      projection_.step_z[static_cast<std::size_t>(i)] = axes_(i, 2);
    }
  }

  IntegrationResult run() {
    map_.next_revision();
    scatter_hits();
    for_each_group();
    result_.ok = true;
    return result_;
  }

  /// Notes the bricks that run() would look into.
  void find(std::vector<std::uint8_t>* bricks) {
    found_ = bricks;
    scatter_hits();
    for_each_group();
  }

 private:
  void for_each_group() {
    const Eigen::Vector3i bricks = map_.size_bricks();
    Eigen::Vector3i group;
    for (group.z() = 0; group.z() < bricks.z(); group.z() += kGroup) {
      for (group.y() = 0; group.y() < bricks.y(); group.y() += kGroup) {
        for (group.x() = 0; group.x() < bricks.x(); group.x() += kGroup) integrate_group(group, kGroup);
      }
    }
  }

  enum class Cover {
    kNothing,   // out of sight or reach
    kFarFree,   // all seen through, the surface farther away than the TSDF's truncation
    kNearFree,  // all seen through
    kMixed
  };
  struct Judged {
    int missed = 0, marked = 0;  // voxels
  };

  void scatter_hits();
  void integrate_group(const Eigen::Vector3i& first, int edge);
  void integrate_all(const Eigen::Vector3i& first, const Eigen::Vector3i& extent, Cover cover);
  void integrate_brick(const Eigen::Vector3i& position, Cover cover);
  Cover classify(const Eigen::Vector3i& first_voxel, const Eigen::Vector3i& voxels) const;
  bool free_all(std::size_t brick);
  bool miss(const std::array<std::uint8_t, OccupancyMap::kBrickVoxels>& missed, OccupancyMap::Brick* brick);
  Eigen::Vector3f project_from(const Eigen::Vector3i& position);
  Judged judge_voxels(const Eigen::Vector3i& position, const HitMask* hits);
  bool update_voxels(const Judged& judged, const HitMask* hits, OccupancyMap::Brick* brick);
  /// Half a voxel's edge, in pixels.
  float half_edge(float depth) const { return 0.5F * resolution_ * std::min(fx_, fy_) / std::max(depth, kNearest); }

  const DepthMap& depth_map_;
  OccupancyMap& map_;
  const std::vector<std::uint8_t>* only_;
  DepthLookup& lookup_;
  std::vector<std::uint32_t>& hits_of_brick_;
  std::vector<HitMask>& hits_;
  float fx_, fy_, cx_, cy_, resolution_, occlusion_range_;
  Eigen::Matrix3f axes_;     // steps of one voxel along x, y, z, camera frame
  Eigen::Matrix3d columns_;  // the same, for positions far from the origin
  Eigen::Vector3d origin_;
  std::vector<std::uint8_t>* found_ = nullptr;
  Tsdf* tsdf_ = nullptr;
  std::optional<TsdfIntegrator> tsdf_integrator_;
  float truncation_ = 0;
  VoxelProjection projection_;
  VoxelVerdicts verdicts_;
  ProjectionKernels kernels_ = best_projection_kernels();
  IntegrationResult result_;
};

void DepthIntegration::scatter_hits() {
  hits_of_brick_.assign(map_.brick_count(), 0);
  hits_.clear();
  const CameraModel& camera = depth_map_.camera;
  const Region& region = map_.region();
  const double per_metre = 1 / region.resolution_m;
  // In voxels from the region's corner: position = start + depth (corner direction + u across + v down).
  const Eigen::Matrix3d rotation = depth_map_.T_world_camera.linear() * per_metre;
  const Eigen::Vector3d start = region.to_voxels(depth_map_.T_world_camera.translation());
  const Eigen::Vector3d across = rotation.col(0) / camera.fx, down = rotation.col(1) / camera.fy;
  const Eigen::Vector3d corner = rotation.col(2) - across * camera.cx - down * camera.cy;
  const Eigen::Array3d size = region.size_voxels.cast<double>();
  const std::vector<float>& surface = lookup_.surface();
  std::size_t pixel = 0;
  Eigen::Vector3i voxel_before(-1, -1, -1);
  std::uint8_t* hit_before = nullptr;
  for (int v = 0; v < camera.height; ++v) {
    const Eigen::Vector3d row = corner + v * down;
    for (int u = 0; u < camera.width; ++u, ++pixel) {
      const float depth = surface[pixel];
      if (depth == std::numeric_limits<float>::infinity()) continue;
      const Eigen::Array3d at = start + static_cast<double>(depth) * (row + u * across);
      if (!(at.x() >= 0 && at.y() >= 0 && at.z() >= 0 && at.x() < size.x() && at.y() < size.y() && at.z() < size.z())) {
        continue;
      }
      const std::uint8_t kind = hit_kind(static_cast<double>(depth_map_.sigma_m[pixel]) * per_metre);
      if (kind == 0) continue;
      const Eigen::Vector3i voxel = at.cast<int>();
      if (voxel == voxel_before) {  // as most often
        if (kind < *hit_before) *hit_before = kind;
        continue;
      }
      std::uint32_t& slot = hits_of_brick_[map_.brick_index(voxel / kEdge)];
      if (slot == 0) {
        hits_.push_back({});
        slot = static_cast<std::uint32_t>(hits_.size());
      }
      std::uint8_t& hit = hits_[slot - 1][OccupancyMap::index_in_brick(voxel)];
      if (hit == 0 || kind < hit) hit = kind;  // the smallest sigma's
      voxel_before = voxel;
      hit_before = &hit;
    }
  }
}

/// What the image says of a box of voxels as a whole.
DepthIntegration::Cover DepthIntegration::classify(const Eigen::Vector3i& first_voxel,
                                                   const Eigen::Vector3i& voxels) const {
  // The box of the voxels' centres, as an axis-parallel box of the camera frame around it.
  const Eigen::Vector3d half = 0.5 * (voxels.cast<double>().array() - 1).matrix();
  const Eigen::Vector3f center = (origin_ + columns_ * (first_voxel.cast<double>() + half)).cast<float>();
  const Eigen::Vector3f spread = axes_.cwiseAbs() * half.cast<float>();
  const float z_min = center.z() - spread.z(), z_max = center.z() + spread.z();
  if (z_max <= kNearest) return Cover::kNothing;
  if (z_min <= kNearest) return Cover::kMixed;
  // Its projection reaches as far as its corners'.
  using Corners = Eigen::Array<float, 1, 8>;
  static const Corners kX{-1, 1, -1, 1, -1, 1, -1, 1}, kY{-1, -1, 1, 1, -1, -1, 1, 1}, kZ{-1, -1, -1, -1, 1, 1, 1, 1};
  const Eigen::Matrix3f edges = axes_ * half.cast<float>().asDiagonal();
  const auto corners = [&](int axis) -> Corners {
    return center[axis] + edges(axis, 0) * kX + edges(axis, 1) * kY + edges(axis, 2) * kZ;
  };
  const Corners inverse = corners(2).inverse();
  const Corners u = fx_ * corners(0) * inverse + cx_, v = fy_ * corners(1) * inverse + cy_;
  const float u_min = u.minCoeff(), u_max = u.maxCoeff(), v_min = v.minCoeff(), v_max = v.maxCoeff();
  const auto width = static_cast<float>(depth_map_.camera.width), height = static_cast<float>(depth_map_.camera.height);
  // Slack for rounding, so that a voxel's own answer is never another.
  constexpr float kDepthSlack = 1 + 1e-5F;
  const float margin = std::min(kSilhouette * half_edge(z_min), kMaxMargin) + 1;
  const int reach = static_cast<int>(std::min(half_edge(z_min), kMaxMargin)) + 1;  // the windows', and rounding
  if (u_max < -margin || v_max < -margin || u_min > width + margin || v_min > height + margin) return Cover::kNothing;
  const auto pixel = [](float at, float end) { return static_cast<int>(std::clamp(at, 0.0F, end)); };
  const DepthLookup::Bounds bounds = lookup_.bounds(pixel(u_min, width) - reach, pixel(u_max, width) + reach,
                                                    pixel(v_min, height) - reach, pixel(v_max, height) + reach);
  if (z_min > kDepthSlack * (bounds.max_reach + occlusion_range_)) return Cover::kNothing;
  const bool inside = u_min >= 1 && v_min >= 1 && u_max < width - 1 && v_max < height - 1;
  if (!inside || !(z_max * kDepthSlack < bounds.min_free)) return Cover::kMixed;
  return z_max * kDepthSlack + truncation_ < bounds.min_free ? Cover::kFarFree : Cover::kNearFree;
}

/// Asks the image about a cube of bricks as a whole, and where it has no one answer about the eighths of it.
void DepthIntegration::integrate_group(const Eigen::Vector3i& first, int edge) {
  const Eigen::Vector3i extent = (map_.size_bricks() - first).cwiseMin(edge);
  const Cover cover = classify(kEdge * first, kEdge * extent);
  if (edge == 1 || cover == Cover::kNothing || cover == Cover::kFarFree) {
    integrate_all(first, extent, cover);
    return;
  }
  const int half = edge / 2;
  for (int z = 0; z < extent.z(); z += half) {
    for (int y = 0; y < extent.y(); y += half) {
      for (int x = 0; x < extent.x(); x += half) integrate_group(first + Eigen::Vector3i(x, y, z), half);
    }
  }
}

/// Integrates bricks of which the image says the same.
void DepthIntegration::integrate_all(const Eigen::Vector3i& first, const Eigen::Vector3i& extent, Cover cover) {
  Eigen::Vector3i offset;
  for (offset.z() = 0; offset.z() < extent.z(); ++offset.z()) {
    for (offset.y() = 0; offset.y() < extent.y(); ++offset.y()) {
      for (offset.x() = 0; offset.x() < extent.x(); ++offset.x()) {
        const Eigen::Vector3i position = first + offset;
        const std::size_t brick = map_.brick_index(position);
        if (only_ != nullptr && (*only_)[brick] == 0) continue;
        if (found_ != nullptr) {
          if (cover != Cover::kNothing || hits_of_brick_[brick] != 0) (*found_)[brick] = 1;
          continue;
        }
        integrate_brick(position, cover);
        if (tsdf_ == nullptr || cover == Cover::kNothing) continue;
        // Far from the surface there is nothing to add but to what stands there already.
        if (cover == Cover::kFarFree && tsdf_->find(brick) == nullptr) continue;
        project_from(position);
        tsdf_integrator_->integrate(brick, projection_);
      }
    }
  }
}

void DepthIntegration::integrate_brick(const Eigen::Vector3i& position, Cover cover) {
  const std::size_t index = map_.brick_index(position);
  const std::uint32_t slot = hits_of_brick_[index];
  if (cover == Cover::kNothing && slot == 0) return;
  const HitMask* hits = slot == 0 ? nullptr : &hits_[slot - 1];
  bool changed = false;
  if ((cover == Cover::kFarFree || cover == Cover::kNearFree) && hits == nullptr) {
    changed = free_all(index);
  } else {
    prefetch(map_.dense(index));
    const Judged judged = judge_voxels(position, hits);
    if (map_.dense(index) == nullptr && hits == nullptr && judged.marked == 0) {
      // A uniform brick stays so if all of it, or nothing, changes.
      const Level level = map_.uniform_level(index);
      if (judged.missed == OccupancyMap::kBrickVoxels) {
        changed = free_all(index);
        result_.bricks_changed += changed;
        return;
      }
      if (judged.missed == 0 || map_.levels().after(VoxelUpdate::kMiss, level) == level) {
        result_.voxels_missed += judged.missed;
        return;
      }
    }
    changed = update_voxels(judged, hits, &map_.open(index));
    map_.close(index, changed);
  }
  result_.bricks_changed += changed;
}

/// The whole brick is seen through.
bool DepthIntegration::free_all(std::size_t brick) {
  result_.voxels_missed += map_.brick_extent(map_.brick_position(brick)).prod();
  if (map_.dense(brick) != nullptr) {
    static constexpr auto kAll = [] {
      std::array<std::uint8_t, OccupancyMap::kBrickVoxels> all{};
      all.fill(1);
      return all;
    }();
    const bool changed = miss(kAll, &map_.open(brick));
    map_.close(brick, changed);
    return changed;
  }
  const Level before = map_.uniform_level(brick), after = map_.levels().after(VoxelUpdate::kMiss, before);
  if (after == before) return false;
  map_.set_uniform_level(brick, after);
  map_.touch(brick);
  return true;
}

/// Updates the voxels that were seen through. True when one changed.
bool DepthIntegration::miss(const std::array<std::uint8_t, OccupancyMap::kBrickVoxels>& missed,
                            OccupancyMap::Brick* brick) {
  LogOddsLevels& levels = map_.levels();
  bool changed = false;
  for (std::size_t row = 0; row < missed.size(); row += kEdge) {
    std::uint64_t any = 0;
    std::memcpy(&any, &missed[row], sizeof any);
    if (any == 0) continue;
    Level* at = &brick->level[row];
    const Level first = at[0];
    unsigned different = 0;
    for (std::size_t i = 1; i < kEdge; ++i) different |= static_cast<unsigned>(at[i] ^ first);
    if (different == 0) {  // most rows are alike: one look-up
      const Level after = levels.after(VoxelUpdate::kMiss, first);
      changed |= after != first;
      for (std::size_t i = 0; i < kEdge; ++i) at[i] = missed[row + i] != 0 ? after : first;
      continue;
    }
    for (std::size_t i = 0; i < kEdge; ++i) {
      const Level after = missed[row + i] != 0 ? levels.after(VoxelUpdate::kMiss, at[i]) : at[i];
      changed |= after != at[i];
      at[i] = after;
    }
  }
  return changed;
}

/// Turns the projection to a brick; the camera coordinates of its first voxel's centre.
Eigen::Vector3f DepthIntegration::project_from(const Eigen::Vector3i& position) {
  const Eigen::Vector3f first = (origin_ + columns_ * (kEdge * position).cast<double>()).cast<float>();
  projection_.first = {first.x(), first.y(), first.z()};
  return first;
}

/// Asks the image about every voxel of a brick; the answers are in verdicts_.
DepthIntegration::Judged DepthIntegration::judge_voxels(const Eigen::Vector3i& position, const HitMask* hits) {
  const Eigen::Vector3i extent = map_.brick_extent(position);
  const Eigen::Vector3f first = project_from(position);
  const float middle = (first + axes_ * Eigen::Vector3f::Constant(0.5F * (kEdge - 1))).z();
  // The window lies within the voxel's inscribed sphere: no pixel of it misses the voxel.
  const float half_width = std::min(half_edge(middle), static_cast<float>(DepthLookup::kMaxHalfWidth));
  projection_.margin = std::min(kSilhouette * half_edge(middle), kMaxMargin);
  projection_.free_limit = lookup_.free_limit_in_window(static_cast<int>(half_width)).data();
  VoxelVerdicts& verdicts = verdicts_;
  kernels_.classify_voxels(projection_, &verdicts);
  if (hits != nullptr) {
    for (std::size_t i = 0; i < hits->size(); ++i) {
      const auto free_of_hits = static_cast<std::uint8_t>((*hits)[i] == 0 ? 0xff : 0);
      verdicts.missed[i] &= free_of_hits;
      verdicts.mark[i] &= free_of_hits;
    }
  }
  if (extent != Eigen::Vector3i::Constant(kEdge)) {
    for (std::size_t i = 0; i < verdicts.missed.size(); ++i) {
      const Eigen::Vector3i voxel(static_cast<int>(i & 7), static_cast<int>(i >> 3 & 7), static_cast<int>(i >> 6));
      if ((voxel.array() < extent.array()).all()) continue;
      verdicts.missed[i] = verdicts.mark[i] = 0;
    }
  }
  Judged judged{verdicts.missed_count, verdicts.mark_count};
  if (hits != nullptr || extent != Eigen::Vector3i::Constant(kEdge)) {  // some were taken back
    judged = {};
    for (const std::uint8_t missed : verdicts.missed) judged.missed += missed;
    for (const std::uint8_t mark : verdicts.mark) judged.marked += mark != 0;
  }
  return judged;
}

/// Puts the verdicts and the hits into the brick. True when a voxel changed.
bool DepthIntegration::update_voxels(const Judged& judged, const HitMask* hits, OccupancyMap::Brick* brick) {
  unsigned marked = 0;
  for (std::size_t i = 0; i < verdicts_.mark.size() && judged.marked != 0; ++i) {
    // No mark, 0, counts as farther than any.
    const auto before = static_cast<std::uint8_t>(brick->mark[i] - 1);
    const auto now = static_cast<std::uint8_t>(verdicts_.mark[i] - 1);
    const std::uint8_t nearer = now < before ? now : before;
    marked += nearer != before;
    brick->mark[i] = static_cast<std::uint8_t>(nearer + 1);
  }
  bool changed = marked != 0;
  if (judged.missed != 0) changed |= miss(verdicts_.missed, brick);
  if (hits != nullptr) {
    for (std::size_t row = 0; row < hits->size(); row += kEdge) {
      std::uint64_t any = 0;
      std::memcpy(&any, &(*hits)[row], sizeof any);
      if (any == 0) continue;
      for (std::size_t i = row; i < row + kEdge; ++i) {
        if ((*hits)[i] == 0) continue;
        ++result_.voxels_hit;
        const Level after = map_.levels().after(static_cast<VoxelUpdate>((*hits)[i] - 1), brick->level[i]);
        changed |= after != brick->level[i];
        brick->level[i] = after;
      }
    }
  }
  result_.voxels_missed += judged.missed;
  result_.voxels_marked += marked;
  if (marked != 0) map_.set_has_marks(true);
  return changed;
}

}  // namespace

IntegrationResult integrate_depth_map(const DepthMap& depth_map, OccupancyMap* map, Tsdf* tsdf,
                                      IntegrationScratch* scratch, const std::vector<std::uint8_t>* only) {
  IntegrationResult result;
  if (!depth_map.valid(&result.error)) return result;
  if (tsdf != nullptr && !(tsdf->region() == map->region())) {
    result.error = "the TSDF has another region than the map";
    return result;
  }
  return DepthIntegration(depth_map, map, tsdf, scratch, only).run();
}

void find_bricks_of(const DepthMap& depth_map, OccupancyMap* map, IntegrationScratch* scratch,
                    std::vector<std::uint8_t>* bricks) {
  DepthIntegration(depth_map, map, nullptr, scratch, nullptr).find(bricks);
}

IntegrationResult OccupancyMap::integrate(const DepthMap& depth_map, Tsdf* tsdf) {
  if (scratch_.held == nullptr) scratch_.held = std::make_unique<IntegrationScratch>();
  return integrate_depth_map(depth_map, this, tsdf, scratch_.held.get());
}

OccupancyMap::Scratch::Scratch() = default;
OccupancyMap::Scratch::~Scratch() = default;

}  // namespace vantage
