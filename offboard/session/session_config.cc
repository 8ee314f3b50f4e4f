#include "offboard/session/session_config.h"

#include <cmath>
#include <fstream>
#include <sstream>
#include <utility>

#include <fmt/format.h>

#include "calib/files/input_error.h"
#include "calib/files/strict_yaml.h"

namespace vantage {
namespace {

constexpr std::int64_t kConfigVersion = 1;

std::string quantity(double value, Quantity kind) { return yaml_quantity(value, kind); }

std::string lengths(const Eigen::Vector3d& v) {
  return fmt::format("[{}, {}, {}]", quantity(v.x(), Quantity::kLength), quantity(v.y(), Quantity::kLength),
                     quantity(v.z(), Quantity::kLength));
}

void read_region(YamlMap map, Region* region) {
  if (map.has("resolution")) region->resolution_m = map.quantity("resolution", Quantity::kLength);
  if (map.has("min") || map.has("size")) {
    const std::vector<double> corner = map.quantities("min", Quantity::kLength, 3);
    const std::vector<double> size = map.quantities("size", Quantity::kLength, 3);
    region->min_corner = {corner[0], corner[1], corner[2]};
    for (int i = 0; i < 3; ++i) {
      const double voxels = std::round(size[static_cast<std::size_t>(i)] / region->resolution_m);
      if (!(voxels >= 1 && voxels <= Region::kMaxSizeVoxels)) {
        map.fail("size", fmt::format("must be 1 to {} voxels of {} m along each axis", Region::kMaxSizeVoxels,
                                     region->resolution_m));
      }
      region->size_voxels[i] = static_cast<int>(voxels);
    }
  }
  if (std::string why; !region->valid(&why)) map.fail("resolution", why);
  map.finish();
}

void read_sensor(YamlMap map, SensorModel* sensor) {
  if (map.has("hit")) sensor->hit_probability = map.number("hit");
  if (map.has("miss")) sensor->miss_probability = map.number("miss");
  if (map.has("clamp")) {
    const std::vector<double> clamp = map.numbers("clamp", 2);
    sensor->clamp_min = clamp[0];
    sensor->clamp_max = clamp[1];
  }
  if (map.has("max_range")) sensor->max_range_m = map.quantity("max_range", Quantity::kLength);
  if (map.has("occlusion_range")) sensor->occlusion_range_m = map.quantity("occlusion_range", Quantity::kLength);
  if (map.has("free_margin_sigmas")) sensor->free_margin_sigmas = map.number("free_margin_sigmas");
  if (std::string why; !sensor->valid(&why)) map.fail("hit", why);
  map.finish();
}

void read_planning(YamlMap map, const std::filesystem::path& folder, PlanningConfig* planning) {
  if (map.has("views")) planning->views = folder / map.text("views");
  if (map.has("method")) {
    std::string why;
    const std::optional<PlanningMethod> method = parse_planning_method(map.text("method"), &why);
    if (!method) map.fail("method", why);
    planning->method = *method;
  }
  for (const char* key : {"gain", "rays"}) {
    if (planning->method != PlanningMethod::kUtility && map.has(key)) map.fail(key, "is of method: utility alone");
  }
  if (planning->method != PlanningMethod::kViewSet && map.has("ground"))
    map.fail("ground", "is of method: view_set alone");
  if (map.has("ground")) planning->ground_m = map.quantity("ground", Quantity::kLength);
  if (map.has("gain")) {
    std::string why;
    const std::optional<Formulation> gain = parse_formulation(map.text("gain"), &why);
    if (!gain) map.fail("gain", why);
    planning->gain = *gain;
  }
  if (map.has("rays")) {
    const std::vector<double> rays = map.numbers("rays", 2);
    for (const double side : rays) {
      if (!(side >= 1 && side <= 4096 && side == std::floor(side)))
        map.fail("rays", "expected whole numbers, 1 to 4096");
    }
    planning->ray_columns = static_cast<int>(rays[0]);
    planning->ray_rows = static_cast<int>(rays[1]);
  }
  PlannerOptions& planner = planning->planner;
  if (map.has("first_view")) planner.first_view = map.integer("first_view");
  if (map.has("most_views")) planner.most_views = map.integer("most_views");
  if (planner.most_views < 1) map.fail("most_views", "must be at least 1");
  if (map.has("gain_threshold")) planner.enough.gain = map.number("gain_threshold");
  if (map.has("gain_share")) planner.enough.share = map.number("gain_share");
  if (!(planner.enough.share >= 0 && planner.enough.share <= 1)) map.fail("gain_share", "expected a share, 0 to 1");
  if (map.has("most_time")) planner.most_seconds = map.quantity("most_time", Quantity::kDuration);
  if (map.has("most_way")) planner.most_way_m = map.quantity("most_way", Quantity::kLength);
  if (planner.most_way_m < 0) map.fail("most_way", "must not be negative");
  map.finish();
}

void read_cloud(YamlMap map, SurfaceCloudOptions* cloud) {
  const auto positive = [&map](std::string_view key, double* value) {
    if (!map.has(key)) return;
    *value = map.quantity(key, Quantity::kLength);
    if (*value <= 0) map.fail(key, "must be positive");
  };
  positive("spacing", &cloud->spacing_m);
  positive("largest_sigma", &cloud->largest_sigma_m);
  positive("max_range", &cloud->max_range_m);
  map.finish();
}

}  // namespace

std::optional<PlanningMethod> parse_planning_method(const std::string& name, std::string* why) {
  if (name == "utility") return PlanningMethod::kUtility;
  if (name == "view_set") return PlanningMethod::kViewSet;
  *why = "there is no method \"" + name + "\"; there are utility, view_set";
  return std::nullopt;
}

SessionConfig parse_session_config(const std::string& text, const std::string& name,
                                   const std::filesystem::path& folder) {
  YamlMap root = YamlMap::parse(text, name);
  if (root.integer("config_version") != kConfigVersion) {
    root.fail("config_version", fmt::format("this program reads version {}", kConfigVersion));
  }
  SessionConfig config;
  if (root.has("region")) read_region(root.map("region"), &config.region);
  if (root.has("sensor")) read_sensor(root.map("sensor"), &config.sensor);
  if (root.has("plan") && !root.boolean("plan")) config.planning.reset();
  if (root.has("planning")) {
    if (!config.planning) root.fail("planning", "contradicts plan: false");
    read_planning(root.map("planning"), folder, &*config.planning);
  }
  if (root.has("cloud")) read_cloud(root.map("cloud"), &config.cloud);
  if (root.has("truth")) config.truth = folder / root.text("truth");
  if (root.has("coverage_distance")) {
    config.coverage_distance_m = root.quantity("coverage_distance", Quantity::kLength);
    if (config.coverage_distance_m <= 0) root.fail("coverage_distance", "must be positive");
  }
  root.finish();
  return config;
}

SessionConfig load_session_config(const std::filesystem::path& path) {
  std::ifstream in(path);
  std::ostringstream text;
  if (!in || !(text << in.rdbuf())) throw InputError(path.string() + ": no such file, or it can't be read");
  return parse_session_config(text.str(), path.string(), path.parent_path());
}

std::string to_yaml(const SessionConfig& config) {
  const Region& region = config.region;
  const SensorModel& sensor = config.sensor;
  std::string text = fmt::format(
      "config_version: {}\n"
      "region:\n  resolution: {}\n  min: {}\n  size: {}\n"
      "sensor:\n  hit: {}\n  miss: {}\n  clamp: [{}, {}]\n  max_range: {}\n  occlusion_range: {}\n"
      "  free_margin_sigmas: {}\n"
      "cloud:\n  spacing: {}\n  largest_sigma: {}\n  max_range: {}\n",
      kConfigVersion, quantity(region.resolution_m, Quantity::kLength), lengths(region.min_corner),
      lengths(region.resolution_m * region.size_voxels.cast<double>()), sensor.hit_probability, sensor.miss_probability,
      sensor.clamp_min, sensor.clamp_max, quantity(sensor.max_range_m, Quantity::kLength),
      quantity(sensor.occlusion_range_m, Quantity::kLength), sensor.free_margin_sigmas,
      quantity(config.cloud.spacing_m, Quantity::kLength), quantity(config.cloud.largest_sigma_m, Quantity::kLength),
      quantity(config.cloud.max_range_m, Quantity::kLength));
  if (const auto& planning = config.planning) {
    text += "planning:\n";
    if (!planning->views.empty()) text += fmt::format("  views: \"{}\"\n", planning->views.string());
    if (planning->method == PlanningMethod::kUtility) {
      text += fmt::format("  method: utility\n  gain: {}\n  rays: [{}, {}]\n", name_of(planning->gain),
                          planning->ray_columns, planning->ray_rows);
    } else {
      text += fmt::format("  method: view_set\n  ground: {}\n", quantity(planning->ground_m, Quantity::kLength));
    }
    const PlannerOptions& planner = planning->planner;
    text += fmt::format("  first_view: {}\n  most_views: {}\n  gain_threshold: {}\n  gain_share: {}\n",
                        planner.first_view, planner.most_views, planner.enough.gain, planner.enough.share);
    text += fmt::format("  most_time: {}\n  most_way: {}\n", quantity(planner.most_seconds, Quantity::kDuration),
                        quantity(planner.most_way_m, Quantity::kLength));
  } else {
    text += "plan: false\n";
  }
  if (!config.truth.empty()) {
    text += fmt::format("truth: \"{}\"\ncoverage_distance: {}\n", config.truth.string(),
                        quantity(config.coverage_distance_m, Quantity::kLength));
  }
  return text;
}

}  // namespace vantage
