// vantage-gain: the information gain of every view of a file through a map, as CSV.

#include <cstdio>
#include <exception>
#include <filesystem>
#include <sstream>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "calib/files/input_error.h"
#include "calib/files/trajectory.h"
#include "calib/program.h"
#include "offboard/gain/view_gain.h"
#include "offboard/mapping/octomap_io.h"

namespace vantage {
namespace {

struct Arguments {
  std::string map, views, camera, rays = "80x60", weights, kernel;
  int threads = 1;
};

std::vector<std::string> split(const std::string& text, char separator) {
  std::vector<std::string> parts;
  std::istringstream in(text);
  for (std::string part; std::getline(in, part, separator);) parts.push_back(part);
  return parts;
}

/// The whole of `text` as a number.
double number(const std::string& option, const std::string& text) {
  std::size_t used = 0;
  double value = 0;
  try {
    value = std::stod(text, &used);
  } catch (const std::exception&) {
    used = 0;
  }
  if (used == 0 || used != text.size()) throw InputError(option + ": \"" + text + "\" is not a number");
  return value;
}

int whole_number(const std::string& option, const std::string& text) {
  const double value = number(option, text);
  if (!(value >= 1 && value <= 65536 && value == static_cast<int>(value))) {
    throw InputError(option + ": \"" + text + "\" is not a whole number from 1 to 65536");
  }
  return static_cast<int>(value);
}

CameraModel parse_camera(const std::string& text) {
  const std::vector<std::string> parts = split(text, ',');
  if (parts.size() != 6) throw InputError("--camera: expected fx,fy,cx,cy,w,h, e.g. 448,448,375.5,239.5,752,480");
  CameraModel camera;
  camera.fx = number("--camera", parts[0]);
  camera.fy = number("--camera", parts[1]);
  camera.cx = number("--camera", parts[2]);
  camera.cy = number("--camera", parts[3]);
  camera.width = whole_number("--camera", parts[4]);
  camera.height = whole_number("--camera", parts[5]);
  std::string why;
  if (!camera.valid(&why)) throw InputError("--camera: " + why);
  return camera;
}

RayBundle parse_rays(const std::string& text, const CameraModel& camera) {
  const std::vector<std::string> parts = split(text, 'x');
  if (parts.size() != 2) throw InputError("--rays: expected columns x rows, e.g. 80x60");
  try {
    return RayBundle(camera, whole_number("--rays", parts[0]), whole_number("--rays", parts[1]));
  } catch (const std::invalid_argument& error) {
    throw InputError(std::string("--rays: ") + error.what());
  }
}

CombinedWeights parse_weights(const std::string& text) {
  CombinedWeights weights;
  if (text.empty()) return weights;
  if (text == "robot") return CombinedWeights::robot();
  weights.weight.fill(0);
  for (const std::string& part : split(text, ',')) {
    const std::vector<std::string> pair = split(part, ':');
    if (pair.size() != 2) throw InputError("--weights: expected name:weight, e.g. average_entropy:30");
    std::string why;
    const auto formulation = parse_formulation(pair[0], &why);
    if (!formulation) throw InputError("--weights: " + why);
    weights[*formulation] = number("--weights", pair[1]);
  }
  return weights;
}

void print_csv(const std::vector<ViewGain>& gains) {
  std::printf("view");
  for (const Formulation formulation : kAllFormulations) std::printf(",%s", std::string(name_of(formulation)).c_str());
  std::printf("\n");
  for (std::size_t view = 0; view < gains.size(); ++view) {
    std::printf("%zu", view);
    for (const Formulation formulation : kAllFormulations) {
      if (gains[view].marks_missing && needs_marks(formulation)) {
        std::printf(",no-marks");
      } else {
        std::printf(",%.9g", gains[view][formulation]);
      }
    }
    std::printf("\n");
  }
}

int run(const Arguments& arguments) {
  const CameraModel camera = parse_camera(arguments.camera);
  const RayBundle rays = parse_rays(arguments.rays, camera);
  GainOptions options;
  options.weights = parse_weights(arguments.weights);
  options.threads = arguments.threads;
  options.kernel = arguments.kernel;
  std::string why;
  if (!options.valid(&why)) throw InputError(why);
  const OccupancyMap map = read_map(arguments.map);
  const std::vector<Eigen::Isometry3d> views = read_pose_list(arguments.views);
  if (!map.has_marks()) {
    std::fprintf(
        stderr,
        "vantage-gain: %s carries no occlusion marks (only a map that Vantage wrote does): proximity_count and "
        "area_factor are not evaluated\n",
        arguments.map.c_str());
  }
  print_csv(evaluate_views(map, rays, views, options));
  return kExitOk;
}

}  // namespace
}  // namespace vantage

int main(int argc, char** argv) {
  using vantage::kExitBadInput;
  vantage::Arguments arguments;
  CLI::App app{"Information gain of every view by every formulation, as CSV"};
  app.set_version_flag("--version", VANTAGE_VERSION);
  app.add_option("--map", arguments.map, "map: an .ot or .bt file")->required();
  app.add_option("--views", arguments.views, "poses T_world_camera, one a line: x y z qx qy qz qw (m)")->required();
  app.add_option("--camera", arguments.camera, "fx,fy,cx,cy,w,h in pixels")->required();
  app.add_option("--rays", arguments.rays, "rays of a view: COLUMNSxROWS (80x60)");
  app.add_option("--weights", arguments.weights, "of combined: name:weight,... or \"robot\"; else the simulation's");
  app.add_option("--threads", arguments.threads, "threads (1)");
  app.add_option("--kernel", arguments.kernel, "scalar, portable, avx2 or avx512 (the machine's best)");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? vantage::kExitOk : kExitBadInput;
  }
  return vantage::run_program("vantage-gain", [&] { return vantage::run(arguments); });
}
