#include "offboard/log/cloud_export.h"

#include <limits>

#include <Eigen/Geometry>

#include "calib/files/input_error.h"
#include "calib/files/ply.h"
#include "lcmtypes/link/message_bus.h"
#include "offboard/log/known_channels.h"
#include "offboard/log/log_maps.h"
#include "offboard/log/log_scan.h"
#include "offboard/session/session_config.h"
#include "offboard/session/surface_cloud.h"

namespace vantage {
namespace {

/// The log's last configuration; the defaults where it has none.
SessionConfig config_of(const std::filesystem::path& log) {
  SessionConfig config;
  scan_whole_log(log, [&](const LogEvent& event) {
    if (event.channel != channel::kSessionConfig) return;
    std::string why;
    const auto message = MessageFields::read(*find_channel(event.channel), event.bytes, &why);
    if (!message) throw InputError(place_of(log, event) + why);
    config = parse_session_config(std::string(message->find("yaml")->strings().front()),
                                  log.string() + " (its configuration)", log.parent_path());
  });
  return config;
}

/// A box around every converged pixel.
Region region_of(const std::filesystem::path& log) {
  Eigen::AlignedBox3d box;
  for_each_depth_map(log, [&](const DepthMap& map) {
    for (std::size_t i = 0; i < map.state.size(); ++i) {
      if (map.state[i] != DepthState::kConverged) continue;
      const auto u = static_cast<double>(i % static_cast<std::size_t>(map.camera.width));
      const auto v = static_cast<double>(i / static_cast<std::size_t>(map.camera.width));
      const auto z = static_cast<double>(map.depth_m[i]);
      box.extend(map.T_world_camera *
                 Eigen::Vector3d((u - map.camera.cx) / map.camera.fx * z, (v - map.camera.cy) / map.camera.fy * z, z));
    }
  });
  if (box.isEmpty()) throw InputError(log.string() + ": no depth map holds a converged pixel");
  constexpr double kLargest_m = 1e6;
  if (!(box.min().minCoeff() > -kLargest_m && box.max().maxCoeff() < kLargest_m)) {
    throw InputError(log.string() + ": its points lie further than 1000 km from the origin");
  }
  Region region;
  region.resolution_m = 1;
  region.min_corner = box.min().array().floor();
  region.size_voxels = (box.max() - region.min_corner).array().floor().cast<int>() + 1;
  return region;
}

}  // namespace

CloudExport export_cloud(const std::filesystem::path& log, const CloudExportOptions& options,
                         const std::filesystem::path& file) {
  Region region;
  SurfaceCloudOptions cloud_options;
  if (options.session_region) {
    const SessionConfig config = config_of(log);
    region = config.region;
    cloud_options = config.cloud;
  } else {
    region = region_of(log);
    cloud_options.largest_sigma_m = cloud_options.max_range_m = std::numeric_limits<double>::infinity();
  }
  if (options.spacing_m) cloud_options.spacing_m = *options.spacing_m;
  constexpr double kMostCells = 1 << 21;  // an edge: SurfaceCloud's keys
  const double extent = (region.max_corner() - region.min_corner).maxCoeff();
  if (!(extent / cloud_options.spacing_m < kMostCells)) {
    throw InputError(log.string() + ": its points lie " + std::to_string(extent) + " m apart; give a larger --spacing");
  }
  SurfaceCloud cloud(region, cloud_options);
  CloudExport result;
  for_each_depth_map(log, [&](const DepthMap& map) {
    cloud.add(map);
    ++result.depth_maps;
  });
  if (cloud.points().empty()) throw InputError(log.string() + ": no point lies in the session's region");
  write_ply(file, {cloud.points(), cloud.normals(), {}});
  result.points = cloud.points().size();
  return result;
}

}  // namespace vantage
