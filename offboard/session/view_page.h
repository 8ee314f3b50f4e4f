#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "calib/files/ply.h"

namespace vantage {

/// Writes a page that any browser shows by itself, without a server or a network: the points, turned by the mouse, and
/// the cameras in the order of the views.
///
/// `cloud`: points with normals, world, m. `cameras`: T_world_camera. `summary`: the page's title.
/// \throws InputError when it can't be written.
void write_view_page(const std::filesystem::path& path, const PlyModel& cloud,
                     const std::vector<Eigen::Isometry3d>& cameras, const std::string& summary);

}  // namespace vantage
