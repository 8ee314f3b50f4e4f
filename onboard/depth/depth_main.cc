// vantage-depth: the dense depth of one key frame of a recording. docs/depth.md.

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <numbers>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/core.h>

#include "calib/files/input_error.h"
#include "calib/program.h"
#include "onboard/depth/cpu_depth_backend.h"
#include "onboard/depth/depth_figures.h"
#include "onboard/depth/depth_files.h"
#include "onboard/depth/depth_filter.h"
#include "onboard/depth/huber_tv.h"
#include "onboard/depth/recording_frames.h"

namespace vantage {
namespace {

struct Arguments {
  std::string folder, out;
  int reference = 0;
  int frames = 45;
  DepthFilterOptions filter;
  bool poses_as_given = false;
  double pose_sigma_m = 0.001;
  double pose_sigma_deg = 0.05;
  double pose_noise_m = 0;
  double pose_turn_noise_deg = 0;
  std::uint64_t seed = 1;
  int threads = 0;
};

void declare(CLI::App& app, Arguments& a) {
  app.set_version_flag("--version", std::string("vantage-depth ") + VANTAGE_VERSION);
  app.add_option("recording", a.folder, "folder in TUM layout: rgb.txt, groundtruth.txt, camera.yaml")->required();
  app.add_option("--reference", a.reference, "number of the key frame: a line of rgb.txt, from 0")
      ->capture_default_str();
  app.add_option("--frames", a.frames, "how many frames after it to use")->capture_default_str();
  app.add_option("--out", a.out, "folder for depth.png, smoothed.png, cloud.ply, picture.png")->required();
  app.add_option("--min", a.filter.min_depth_m, "nearest depth, metres")->capture_default_str();
  app.add_option("--max", a.filter.max_depth_m, "farthest depth, metres")->capture_default_str();
  app.add_option("--pose-sigma", a.pose_sigma_m, "standard deviation of the given places, each axis, metres")
      ->capture_default_str();
  app.add_option("--pose-turn-sigma", a.pose_sigma_deg, "of the given turns, each axis, degrees")
      ->capture_default_str();
  app.add_flag("--poses-as-given", a.poses_as_given, "do not mend the poses by the images");
  app.add_option("--pose-noise", a.pose_noise_m, "adds noise of this sigma to each place: for trials, metres");
  app.add_option("--pose-turn-noise", a.pose_turn_noise_deg, "the same for each turn, degrees");
  app.add_option("--seed", a.seed, "of that noise")->capture_default_str();
  app.add_option("--threads", a.threads, "0: one a core")->check(CLI::Range(0, 256));
}

void check(const Arguments& a, const RecordingFrames& recording) {
  if (std::string why; !a.filter.valid(&why)) throw InputError("--min, --max: " + why);
  if (a.frames < 1) throw InputError("--frames: at least one is needed");
  if (!(a.pose_sigma_m >= 0 && a.pose_sigma_deg >= 0 && a.pose_noise_m >= 0 && a.pose_turn_noise_deg >= 0)) {
    throw InputError("--pose-sigma, --pose-turn-sigma, --pose-noise, --pose-turn-noise: can't be negative");
  }
  if (a.reference < 0 || a.reference + 1 >= recording.size()) {
    throw InputError(fmt::format("--reference: {} has no frame after it; the recording has {} frames", a.reference,
                                 recording.size()));
  }
}

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// The line that scripts read. Without a truth the figures that need one are null.
void print_figures(int frames, double ms_median, const DepthMap& map, const DepthMap& smoothed,
                   const std::vector<float>& truth) {
  const std::vector<float> none(map.depth_m.size(), 0.0F);
  const bool known = !truth.empty();
  const DepthFigures raw = depth_figures(map, known ? truth : none), tv = depth_figures(smoothed, known ? truth : none);
  const auto figure = [known](double value) { return known ? fmt::format("{:.5f}", value) : std::string("null"); };
  fmt::print(
      "{{\"frames\": {}, \"ms_median\": {:.2f}, \"converged\": {:.5f}, \"precision_5\": {}, \"completeness_5\": {}, "
      "\"median_rel_error\": {}, \"smoothed_precision_5\": {}, \"smoothed_completeness_5\": {}}}\n",
      frames, ms_median, raw.converged, figure(raw.precision_5), figure(raw.completeness_5),
      figure(raw.median_rel_error), figure(tv.precision_5), figure(tv.completeness_5));
}

int run(Arguments& a) {
  const RecordingFrames recording(a.folder);
  check(a, recording);
  std::error_code error;
  std::filesystem::create_directories(a.out, error);
  if (error) throw InputError("--out: " + a.out + ": " + error.message());
  a.filter.refine_poses = !a.poses_as_given;

  WorkerPool pool(a.threads);
  const CameraModel& camera = recording.camera();
  DepthFilter filter(camera, a.filter, {},
                     std::make_unique<CpuDepthBackend>(camera.width, camera.height, a.filter, &pool), &pool);
  std::mt19937_64 random(a.seed);
  std::normal_distribution<double> noise(0, 1);
  const auto posed = [&](int index) {
    std::optional<PosedImage> frame = recording.frame(index);
    if (!frame) return frame;
    for (int k = 0; k < 3; ++k) frame->T_world_camera.translation()(k) += a.pose_noise_m * noise(random);
    if (a.pose_turn_noise_deg > 0) {
      for (int k = 0; k < 3; ++k) {
        frame->T_world_camera.rotate(Eigen::AngleAxisd(a.pose_turn_noise_deg * std::numbers::pi / 180 * noise(random),
                                                       Eigen::Vector3d(Eigen::Vector3d::Unit(k))));
      }
    }
    const double turn = a.pose_sigma_deg * std::numbers::pi / 180;
    frame->covariance.diagonal().head<3>().setConstant(a.pose_sigma_m * a.pose_sigma_m);
    frame->covariance.diagonal().tail<3>().setConstant(turn * turn);
    return frame;
  };

  const std::optional<PosedImage> key = posed(a.reference);
  if (!key) throw InputError(fmt::format("--reference: frame {} has no pose within 20 ms", a.reference));
  if (filter.start(*key) != FrameUse::kUsed)
    throw InputError("--reference: the key frame's pose is not a rigid motion");
  std::vector<double> times_ms;
  const int end = std::min(recording.size(), a.reference + a.frames + 1);
  for (int i = a.reference + 1; i < end; ++i) {
    const std::optional<PosedImage> frame = posed(i);
    if (!frame) continue;
    const auto begin = std::chrono::steady_clock::now();
    if (filter.update(*frame) != FrameUse::kUsed) continue;
    times_ms.push_back(std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count());
  }

  const DepthMap map = filter.depth_map();
  DepthMap smoothed = map;
  HuberTvSmoother(camera.width, camera.height, {}, &pool).smooth(key->image, &smoothed);
  std::vector<PixelBelief> beliefs;
  std::vector<PixelState> states;
  filter.read(&beliefs, &states);
  const std::filesystem::path out(a.out);
  write_depth_png(out / "depth.png", map, recording.depth_unit_m());
  write_depth_png(out / "smoothed.png", smoothed, recording.depth_unit_m());
  write_depth_ply(out / "cloud.ply", smoothed);
  write_depth_picture(out / "picture.png", key->image, map, states);
  if (filter.refused() > 0) fmt::print("{} frames refused: no rigid pose, or out of order\n", filter.refused());
  print_figures(filter.frames(), median(times_ms), map, smoothed, recording.true_depth(a.reference));
  return kExitOk;
}

}  // namespace
}  // namespace vantage

int main(int argc, char** argv) {
  CLI::App app("Dense depth of one key frame of a recording, from the frames that follow it.");
  vantage::Arguments arguments;
  vantage::declare(app, arguments);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? vantage::kExitOk : vantage::kExitBadInput;
  }
  return vantage::run_program("vantage-depth", [&] { return vantage::run(arguments); });
}
