#include "offboard/experiment/other_side_count.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <unordered_map>

#include <Eigen/Dense>

#include "offboard/experiment/surface_network.h"
#include "offboard/experiment/view_set_planner.h"
#include "offboard/planning/volume.h"
#include "offboard/session/session_config.h"

namespace vantage {
namespace {

constexpr double kLeastAbove = -0.2;

int bin_of(double value, double least, int bins) {
  return std::clamp(static_cast<int>(std::lround((value - least) * 10)), 0, bins - 1);
}

/// Points of the true surface by the voxel that they lie in.
struct SurfaceVoxels {
  SurfaceVoxels(const std::vector<Eigen::Vector3f>& surface, const Region& region) {
    const Eigen::Matrix<std::size_t, 3, 1> size = region.size_voxels.cast<std::size_t>();
    for (std::size_t i = 0; i < surface.size(); ++i) {
      Eigen::Vector3i voxel;
      if (!region.voxel_at(surface[i].cast<double>(), &voxel)) continue;
      const Eigen::Matrix<std::size_t, 3, 1> v = voxel.cast<std::size_t>();
      points[static_cast<std::uint32_t>(v.x() + size.x() * (v.y() + size.y() * v.z()))].push_back(i);
    }
    if (!points.empty()) a_voxel = static_cast<double>(surface.size()) / static_cast<double>(points.size());
  }
  std::unordered_map<std::uint32_t, std::vector<std::size_t>> points;
  double a_voxel = 1;  // mean number of points
};

using Bits = std::vector<std::uint64_t>;

/// One view that is open.
void count_view(const ExpectedViews& expected, const std::vector<ExpectedVoxel>& seen, const Eigen::Vector3d& camera_m,
                const Region& region, const SurfaceVoxels& surface, const Bits& covers, const Bits& covered,
                OtherSideCount* count) {
  const auto width = static_cast<std::uint32_t>(region.size_voxels.x()),
             depth = static_cast<std::uint32_t>(region.size_voxels.y());
  const Eigen::Vector3d camera = region.to_voxels(camera_m);
  for (const ExpectedVoxel& voxel : seen) {
    const std::uint32_t v = voxel.voxel;
    const Eigen::Vector3d centre(v % width + 0.5, v / width % depth + 0.5, v / width / depth + 0.5);
    double found = 0;
    if (const auto in = surface.points.find(v); in != surface.points.end()) {
      for (const std::size_t i : in->second) found += (covers[i / 64] & ~covered[i / 64]) >> i % 64 & 1 ? 1 : 0;
    }
    count->add(expected.bearing(v, (camera - centre).normalized()),
               static_cast<double>(expected.prior()[v] * voxel.probability), found / surface.a_voxel);
  }
}

OtherSideCount count_scene(const SceneViews& scene, const SceneTruth& truth, const ExperimentOptions& options) {
  const SessionConfig session;
  Volume volume(session.region, sensor_of(options));
  const SurfaceVoxels surface(truth.surface, session.region);
  ExpectedViewOptions either_side;
  either_side.other_side = {};
  const Eigen::Vector3d focus = focus_of(scene.candidates(), Eigen::Vector3d::Zero());
  OtherSideCount count;
  ViewSetPlanner planner;
  std::vector<CandidateView> open = scene.candidates();
  std::vector<std::int64_t> visited;
  std::vector<Eigen::Isometry3d> poses;
  std::vector<TakenView> taken;
  Bits covered(truth.by_view.covered.front().size());
  auto next = static_cast<std::size_t>(first_view_of_seed(scene.seed(), open.size()));
  std::vector<ExpectedVoxel> promised;
  for (int views = 1; views < options.views && open.size() > 1; ++views) {
    const CandidateView view = open[next];
    const auto place = static_cast<std::size_t>(view.id);
    const DepthMap depth = scene.depth_map(place);
    const IntegrationResult integrated = volume.integrate(depth);
    if (!integrated.ok) throw std::logic_error("a depth map can't be integrated: " + integrated.error);
    for (std::size_t w = 0; w < covered.size(); ++w) covered[w] |= truth.by_view.covered[place][w];
    open.erase(open.begin() + static_cast<std::ptrdiff_t>(next));
    visited.push_back(view.id);
    poses.push_back(view.T_world_camera);
    taken.push_back({view.T_world_camera.translation(), std::move(promised)});

    next = planner.choose({volume.map(), depth.camera, open, visited, poses});
    const std::vector<float> expected_surface =
        expect_surface(SurfaceNetwork::built_in(), volume.map(), depth.camera, poses, focus);
    ExpectedViews expected(volume.map(), expected_surface, taken, either_side);
    for (std::size_t i = 0; i < open.size(); ++i) {
      const Eigen::Isometry3d& pose = open[i].T_world_camera;
      std::vector<ExpectedVoxel> seen = expected.see(expected.rays_for(depth.camera, pose), pose);
      count_view(expected, seen, pose.translation(), session.region, surface,
                 truth.by_view.covered[static_cast<std::size_t>(open[i].id)], covered, &count);
      if (i == next) promised = std::move(seen);
    }
  }
  return count;
}

}  // namespace

void OtherSideCount::add(const Bearing& bearing, double expected, double found) {
  const std::size_t kind = bearing.faces * VoxelSurroundings::kHidings + bearing.hiding;
  const auto away = static_cast<std::size_t>(bin_of(bearing.away, -1, kAwayBins)),
             above = static_cast<std::size_t>(bin_of(bearing.above, kLeastAbove, kAboveBins));
  Bin& bin = bins_[(kind * kAwayBins + away) * kAboveBins + above];
  bin.expected += expected;
  bin.found += found;
}

void OtherSideCount::add(const OtherSideCount& other) {
  for (std::size_t i = 0; i < bins_.size(); ++i) {
    bins_[i].expected += other.bins_[i].expected;
    bins_[i].found += other.bins_[i].found;
  }
}

OtherSides OtherSideCount::fit(double least_expected) const {
  constexpr int kIterations = 60;
  constexpr double kLongestStep = 0.5, kRidge = 1e-3;
  constexpr std::size_t kBins = std::size_t{kAwayBins} * kAboveBins;
  OtherSides sides{};
  for (std::size_t kind = 0; kind < 2 * VoxelSurroundings::kHidings; ++kind) {
    double all = 0;
    for (std::size_t b = 0; b < kBins; ++b) all += bins_[kind * kBins + b].expected;
    if (all < least_expected) continue;
    Eigen::Vector3d w = Eigen::Vector3d::Zero();
    for (int iteration = 0; iteration < kIterations; ++iteration) {
      Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
      Eigen::Matrix3d hessian = kRidge * Eigen::Matrix3d::Identity();
      for (std::size_t b = 0; b < kBins; ++b) {
        const Bin& bin = bins_[kind * kBins + b];
        const Eigen::Vector3d x(1, 0.1 * static_cast<double>(b / kAboveBins) - 1,
                                0.1 * static_cast<double>(b % kAboveBins) + kLeastAbove);
        const double expected = bin.expected * std::exp(w.dot(x));
        gradient += (bin.found - expected) * x;
        hessian += expected * x * x.transpose();
      }
      const Eigen::Vector3d step = hessian.ldlt().solve(gradient);
      w += step.cwiseMax(-kLongestStep).cwiseMin(kLongestStep);
    }
    sides[kind / VoxelSurroundings::kHidings][kind % VoxelSurroundings::kHidings] = {w[0], w[1], w[2]};
  }
  return sides;
}

std::optional<OtherSideCount> count_other_sides(const std::vector<ExperimentObject>& objects,
                                                const MeasuredScenesOptions& options, const std::atomic<bool>& stop,
                                                std::ostream& terminal) {
  OtherSideCount all;
  const bool whole =
      for_each_measured_scene(objects, options, stop, [&](const SceneViews& scene, const SceneTruth& truth) {
        all.add(count_scene(scene, truth, options.run));
        terminal << scene.object().name << " seed " << scene.seed() << ": counted" << std::endl;
      });
  if (!whole) return std::nullopt;
  return all;
}

}  // namespace vantage
