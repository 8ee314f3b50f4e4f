#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

namespace vantage {

struct CloudExportOptions {
  /// True: the points that a session keeps, with the region, range, sigma and spacing of the log's configuration (its
  /// cloud.ply). False: every converged pixel.
  bool session_region = false;
  std::optional<double> spacing_m;  ///< one point a cell of this edge; none: the session's, or 2 mm
};

struct CloudExport {
  std::int64_t depth_maps = 0;
  std::size_t points = 0;
};

/// Writes the depth maps' points with their normals as PLY, world frame, m.
/// \throws InputError when the log is none or damaged or holds no point, or the file can't be written.
CloudExport export_cloud(const std::filesystem::path& log, const CloudExportOptions& options,
                         const std::filesystem::path& file);

}  // namespace vantage
