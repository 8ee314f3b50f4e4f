// vantage-import: a folder of depth images and poses becomes an LCM log that vantage-offboard replays into a map.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>

#include <CLI/CLI.hpp>
#include <vantage/session_config_t.hpp>

#include "calib/files/input_error.h"
#include "calib/program.h"
#include "lcmtypes/link/depth_codec.h"
#include "lcmtypes/link/message_bus.h"
#include "lcmtypes/link/pending_log.h"
#include "offboard/import/recording.h"
#include "offboard/session/session_config.h"

namespace vantage {
namespace {

struct Arguments {
  std::string folder, out, left_out_log;
  std::optional<RecordingLayout> layout;
  std::vector<double> camera;  // fx, fy, cx, cy
  double resolution_m = 0.02;
  double max_depth_m = 5;
  int leave_out = 0;
  DepthNoise noise;
};

/// The box that holds all but a thousandth of the measured points at either end of each axis, and every camera.
Region region_of(const Recording& recording, const Arguments& arguments) {
  constexpr int kPixelStep = 8;
  constexpr double kOutliers = 0.001;
  constexpr double kMarginVoxels = 3;
  std::vector<double> coordinates[3];
  for (const RecordedDepth& frame : recording.frames) {
    const DepthMap map = read_recorded_depth(frame, recording.camera, arguments.noise, arguments.max_depth_m);
    for (int v = 0; v < map.camera.height; v += kPixelStep) {
      for (int u = 0; u < map.camera.width; u += kPixelStep) {
        const auto i =
            static_cast<std::size_t>(v) * static_cast<std::size_t>(map.camera.width) + static_cast<std::size_t>(u);
        if (map.state[i] == DepthState::kInvalid) continue;
        const double z = static_cast<double>(map.depth_m[i]);
        const Eigen::Vector3d point = map.T_world_camera * Eigen::Vector3d((u - map.camera.cx) / map.camera.fx * z,
                                                                           (v - map.camera.cy) / map.camera.fy * z, z);
        for (int axis = 0; axis < 3; ++axis) coordinates[axis].push_back(point[axis]);
      }
    }
  }
  if (coordinates[0].empty()) throw InputError(arguments.folder + ": no depth image holds a measurement");
  Region region;
  region.resolution_m = arguments.resolution_m;
  for (int axis = 0; axis < 3; ++axis) {
    auto& values = coordinates[axis];
    const auto at = [&values](double share) {
      const auto nth = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
      std::nth_element(values.begin(), nth, values.end());
      return *nth;
    };
    double low = at(kOutliers), high = at(1 - kOutliers);
    for (const RecordedDepth& frame : recording.frames) {
      low = std::min(low, frame.T_world_camera.translation()[axis]);
      high = std::max(high, frame.T_world_camera.translation()[axis]);
    }
    const double first = std::floor(low / arguments.resolution_m - kMarginVoxels);
    const double voxels = std::ceil(high / arguments.resolution_m + kMarginVoxels) - first;
    if (voxels > Region::kMaxSizeVoxels) {
      throw InputError(arguments.folder + ": the recording is " + std::to_string(high - low) + " m long, more than " +
                       std::to_string(Region::kMaxSizeVoxels) + " voxels; give a larger --resolution");
    }
    region.min_corner[axis] = first * arguments.resolution_m;
    region.size_voxels[axis] = static_cast<int>(voxels);
  }
  return region;
}

/// A ray to the image's corner is longer than its depth along z.
double longest_ray(const CameraModel& camera, double depth_m) {
  const double x = std::max(camera.cx, camera.width - camera.cx) / camera.fx;
  const double y = std::max(camera.cy, camera.height - camera.cy) / camera.fy;
  return depth_m * std::sqrt(1 + x * x + y * y);
}

std::optional<RecordingCamera> given_camera(const std::vector<double>& numbers) {
  if (numbers.empty()) return std::nullopt;
  RecordingCamera camera;
  camera.camera.fx = numbers[0];
  camera.camera.fy = numbers[1];
  camera.camera.cx = numbers[2];
  camera.camera.cy = numbers[3];
  if (numbers.size() == 5) camera.depth_unit_m = numbers[4];
  const bool finite = std::all_of(numbers.begin(), numbers.end(), [](double n) { return std::isfinite(n); });
  if (!finite || numbers[0] <= 0 || numbers[1] <= 0 || camera.depth_unit_m <= 0) {
    throw InputError("--camera: focal lengths and depth unit must be positive, all numbers finite");
  }
  return camera;
}

int run(const Arguments& arguments) {
  const Recording recording = open_recording(arguments.folder, arguments.layout, given_camera(arguments.camera));
  SessionConfig config;
  config.planning.reset();
  config.region = region_of(recording, arguments);
  CameraModel camera = recording.camera.camera;
  if (camera.width == 0) {
    camera =
        read_recorded_depth(recording.frames.front(), recording.camera, arguments.noise, arguments.max_depth_m).camera;
  }
  config.sensor.max_range_m = longest_ray(camera, arguments.max_depth_m);
  config.cloud = {.spacing_m = arguments.resolution_m / 2,
                  .largest_sigma_m = arguments.resolution_m * 2,
                  .max_range_m = arguments.max_depth_m};

  PendingLog kept(arguments.out);
  std::optional<PendingLog> left_out;
  if (arguments.leave_out > 0) {
    left_out.emplace(arguments.left_out_log.empty() ? arguments.out + ".left-out" : arguments.left_out_log);
  }
  session_config_t first;
  first.utime = std::llround(recording.frames.front().time_s * 1e6);
  first.yaml = to_yaml(config);
  kept.writer().write(first.utime, channel::kSessionConfig, encode_message(first));
  std::int64_t number = 0, kept_maps = 0;
  for (const RecordedDepth& frame : recording.frames) {
    DepthMap map = read_recorded_depth(frame, recording.camera, arguments.noise, arguments.max_depth_m);
    map.map_id = ++number;
    const bool out = arguments.leave_out > 0 && number % arguments.leave_out == 0;
    LogWriter& log = out ? left_out->writer() : kept.writer();
    log.write(map.utime, channel::kDepthMap, encode_message(pack_depth_map(map)));
    if (!out) ++kept_maps;
  }
  kept.commit();
  if (left_out) left_out->commit();
  const Eigen::Vector3d size = config.region.resolution_m * config.region.size_voxels.cast<double>();
  std::printf("%lld depth maps in %s, %lld left out, %zu without a pose; region %.2f x %.2f x %.2f m at %g m\n",
              static_cast<long long>(kept_maps), arguments.out.c_str(), static_cast<long long>(number - kept_maps),
              recording.without_pose, size.x(), size.y(), size.z(), arguments.resolution_m);
  return kExitOk;
}

}  // namespace
}  // namespace vantage

int main(int argc, char** argv) {
  using namespace vantage;
  CLI::App app("Turns a folder of depth images and poses into an LCM log of depth maps.", "vantage-import");
  Arguments arguments;
  app.add_option("folder", arguments.folder,
                 "the recording (7-Scenes, TUM RGB-D, or depth images and a TUM trajectory)")
      ->required();
  app.add_option("--out", arguments.out, "the log to write")->required();
  app.add_option("--layout", arguments.layout, "of the folder (default: what fits)")
      ->transform(CLI::CheckedTransformer(
          std::map<std::string, RecordingLayout>{{"7scenes", RecordingLayout::kSevenScenes},
                                                 {"tum", RecordingLayout::kTum},
                                                 {"trajectory", RecordingLayout::kTrajectory}}));
  app.add_option("--camera", arguments.camera, "of the depth images: fx,fy,cx,cy[,metres of one step]")
      ->delimiter(',')
      ->expected(4, 5);
  app.add_option("--resolution", arguments.resolution_m, "voxel edge of the map, m")
      ->check(CLI::Range(1e-4, 10.0))
      ->capture_default_str();
  app.add_option("--max-depth", arguments.max_depth_m, "further measurements are left out, m")
      ->check(CLI::Range(0.1, 60.0))
      ->capture_default_str();
  app.add_option("--sigma", arguments.noise.sigma_at_1m, "standard deviation at 1 m; grows with the square of depth, m")
      ->check(CLI::Range(1e-6, 1.0))
      ->capture_default_str();
  app.add_option("--leave-out", arguments.leave_out, "keep every K-th depth map out of the log, to judge the map by")
      ->check(CLI::Range(2, 1000000));
  app.add_option("--left-out-log", arguments.left_out_log, "where those go (default: the log's name and .left-out)");
  app.set_version_flag("--version", VANTAGE_VERSION);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kExitOk : kExitBadInput;
  }
  return run_program("vantage-import", [&] { return run(arguments); });
}
