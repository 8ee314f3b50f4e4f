#include "offboard/experiment/learning_states.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <fstream>
#include <map>
#include <stdexcept>
#include <unordered_set>

#include "calib/files/input_error.h"
#include "offboard/experiment/split_mix.h"
#include "offboard/lookahead/map_window.h"
#include "offboard/lookahead/surface_network.h"
#include "offboard/lookahead/view_set_planner.h"
#include "offboard/planning/volume.h"
#include "offboard/session/session_config.h"

namespace vantage {
namespace {

static_assert(std::endian::native == std::endian::little);

template <typename T>
void put(std::ofstream& file, const T* data, std::size_t count) {
  file.write(reinterpret_cast<const char*>(data), static_cast<std::streamsize>(count * sizeof(T)));
}

/// By what a run chooses its views.
enum class Policy { kRandom, kHalfGreedy, kViewSet };

class StateWriter {
 public:
  StateWriter(const SceneViews& scene, const SceneTruth& truth, const LearningStatesOptions& options,
              std::ofstream& file)
      : scene_(scene),
        truth_(truth),
        options_(options),
        file_(file),
        foot_(focus_of(scene.candidates(), Eigen::Vector3d::Zero()).cwiseProduct(Eigen::Vector3d(1, 1, 0))),
        random_(scene.seed()) {}

  void write() {
    head();
    constexpr Policy kPolicies[] = {Policy::kRandom, Policy::kHalfGreedy, Policy::kViewSet};
    for (int r = 0; r < options_.runs; ++r) run(kPolicies[r % 3], r);
  }

 private:
  void head() {
    const Region region = SessionConfig().region;
    const Volume empty(region, sensor_of(options_.scenes.run));
    const MapWindow window(empty.map(), scene_.depth_map(0).camera, {}, foot_);
    const Eigen::Vector3i size(MapWindow::kWidth, MapWindow::kWidth, MapWindow::kHeight);
    std::vector<std::int32_t> voxels;
    std::unordered_set<std::int32_t> holding;
    for (const Eigen::Vector3f& point : truth_.surface) {
      const Eigen::Vector3i v =
          region.to_voxels(point.cast<double>()).array().floor().cast<int>().matrix() - window.min_corner();
      const bool inside = (v.array() >= 0).all() && (v.array() < size.array()).all();
      voxels.push_back(inside ? v.x() + size.x() * (v.y() + size.y() * v.z()) : -1);
      if (inside) holding.insert(voxels.back());
    }
    const std::uint32_t numbers[] = {MapWindow::kChannels,
                                     MapWindow::kWidth,
                                     MapWindow::kHeight,
                                     static_cast<std::uint32_t>(scene_.candidates().size()),
                                     static_cast<std::uint32_t>(voxels.size()),
                                     static_cast<std::uint32_t>(options_.runs * (options_.scenes.run.views - 1))};
    file_ << "VANTAGE-STATES-2";
    put(file_, numbers, std::size(numbers));
    const float in_a_voxel =
        static_cast<float>(voxels.size()) / static_cast<float>(std::max<std::size_t>(1, holding.size()));
    put(file_, &in_a_voxel, 1);
    for (const CandidateView& view : scene_.candidates()) {
      const Eigen::Vector3f at =
          (region.to_voxels(view.T_world_camera.translation()) - window.min_corner().cast<double>()).cast<float>();
      put(file_, at.data(), 3);
    }
    put(file_, voxels.data(), voxels.size());
    for (std::size_t i = 0; i < voxels.size(); ++i) {
      std::uint64_t covering = 0;
      for (std::size_t view = 0; view < truth_.by_view.covered.size(); ++view) {
        covering |= (truth_.by_view.covered[view][i / 64] >> i % 64 & 1) << view;
      }
      put(file_, &covering, 1);
    }
  }

  std::size_t choose(Policy policy, const Choice& choice, ViewSetPlanner* planner, ViewChooser* oracle) {
    if (policy == Policy::kViewSet) return planner->choose(choice).place;
    if (policy == Policy::kHalfGreedy && random_.next() % 2 == 0) return oracle->choose(choice).place;
    return random_.next() % choice.open.size();
  }

  void run(Policy policy, int number) {
    Volume volume(SessionConfig().region, sensor_of(options_.scenes.run));
    std::vector<CandidateView> open = scene_.candidates();
    std::vector<std::int64_t> visited;
    std::vector<Eigen::Isometry3d> poses;
    ViewSetPlanner planner;
    const std::unique_ptr<ViewChooser> oracle = make_chooser("oracle", scene_.seed(), truth_.by_view);
    std::uint64_t taken = 0;
    std::vector<TakenView> taken_views;
    std::vector<ExpectedVoxel> promised;
    std::size_t next = number == 2 ? 0 : random_.next() % open.size();
    for (int views = 1; views < options_.scenes.run.views; ++views) {
      const CandidateView view = open[next];
      const DepthMap depth = scene_.depth_map(static_cast<std::size_t>(view.id));
      const IntegrationResult integrated = volume.integrate(depth);
      if (!integrated.ok) throw std::logic_error("a depth map can't be integrated: " + integrated.error);
      open.erase(open.begin() + static_cast<std::ptrdiff_t>(next));
      visited.push_back(view.id);
      poses.push_back(view.T_world_camera);
      taken |= std::uint64_t{1} << view.id;
      const MapWindow window(volume.map(), depth.camera, poses, foot_);
      put(file_, &taken, 1);
      put(file_, window.numbers().data(), window.numbers().size());
      taken_views.push_back({view.T_world_camera.translation(), std::move(promised)});
      const Choice choice{volume.map(), depth.camera, open, visited, poses};
      next = choose(policy, choice, &planner, oracle.get());
      promised = put_expected(choice, window, taken_views, next);
    }
  }

  /// What open candidates are expected to measure. Returns what the one at `next` is.
  std::vector<ExpectedVoxel> put_expected(const Choice& choice, const MapWindow& window,
                                          const std::vector<TakenView>& taken, std::size_t next) {
    const Region& region = choice.map.region();
    ExpectedSurface surface = SurfaceNetwork::built_in().expect(window);
    const std::vector<Lean> lean = std::exchange(surface.lean, {});
    ExpectedViews expected(choice.map, surface, taken);
    const auto see = [&](const Eigen::Isometry3d& pose) {
      return expected.see(expected.rays_for(choice.camera, pose), pose);
    };
    std::map<std::uint32_t, std::vector<std::uint8_t>> shares;
    for (const CandidateView& view : choice.open) {
      for (const ExpectedVoxel& seen : see(view.T_world_camera)) {
        const std::size_t place = surface.place(region.voxel_of(seen.voxel));
        std::vector<std::uint8_t>& of_voxel = shares[static_cast<std::uint32_t>(place)];
        of_voxel.resize(scene_.candidates().size());
        of_voxel[static_cast<std::size_t>(view.id)] = static_cast<std::uint8_t>(std::lround(255 * seen.probability));
      }
    }
    const auto count = static_cast<std::uint32_t>(shares.size());
    put(file_, &count, 1);
    for (const auto& [voxel, of_voxel] : shares) {
      put(file_, &voxel, 1);
      put(file_, of_voxel.data(), of_voxel.size());
    }
    surface.lean = lean;
    return see(choice.open[next].T_world_camera);
  }

  const SceneViews& scene_;
  const SceneTruth& truth_;
  const LearningStatesOptions& options_;
  std::ofstream& file_;
  Eigen::Vector3d foot_;
  SplitMix random_;
};

}  // namespace

bool write_learning_states(const std::vector<ExperimentObject>& objects, const LearningStatesOptions& options,
                           const std::filesystem::path& out, const std::atomic<bool>& stop, std::ostream& terminal) {
  std::error_code error;
  std::filesystem::create_directories(out, error);
  if (error) throw InputError(out.string() + ": can't be made: " + error.message());
  return for_each_measured_scene(objects, options.scenes, stop, [&](const SceneViews& scene, const SceneTruth& truth) {
    const std::filesystem::path path = out / (scene.object().name + "-seed" + std::to_string(scene.seed()) + ".states");
    std::ofstream file(path, std::ios::binary);
    StateWriter(scene, truth, options, file).write();
    file.close();
    if (!file) throw InputError(path.string() + ": can't be written");
    terminal << path.string() << std::endl;
  });
}

}  // namespace vantage
