#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <Eigen/Geometry>

namespace vantage {

/// A pose and its time, as a line of a TUM trajectory holds them.
struct StampedPose {
  double time_s = 0;
  Eigen::Isometry3d T_world_camera = Eigen::Isometry3d::Identity();
};

/// Reads a TUM trajectory: lines of "timestamp tx ty tz qx qy qz qw" (s, m), '#' starts a comment.
/// \throws InputError "file:line: …" for a line of another form, a number that is not finite, a quaternion that is not
/// of unit length (to 1e-2; it is normalised), times that do not rise.
std::vector<StampedPose> read_tum_trajectory(const std::filesystem::path& path);

/// The pose nearest in time, none when that is further than `largest_gap_s` (TUM's own tools take 20 ms).
/// \pre the times rise.
const StampedPose* nearest_pose(const std::vector<StampedPose>& trajectory, double time_s, double largest_gap_s = 0.02);

/// The same form, whole or not at all. \throws InputError when it can't be written.
void write_tum_trajectory(const std::filesystem::path& path, const std::vector<StampedPose>& trajectory);

/// Reads a pose that stands alone in a file, as a row-major 4 x 4 matrix (7-Scenes). The rotation is made orthonormal.
/// \throws InputError when the numbers are not 16, not finite, or not near a rigid motion (1e-2).
Eigen::Isometry3d read_matrix_pose(const std::filesystem::path& path);

/// Reads poses of a candidate file: lines of "x y z qx qy qz qw" (m; T_world_camera). \throws InputError as above.
std::vector<Eigen::Isometry3d> read_pose_list(const std::filesystem::path& path);

/// One line of a TUM file list (rgb.txt, depth.txt): "timestamp file".
struct StampedFile {
  double time_s = 0;
  std::filesystem::path path;  ///< resolved against the list's own folder
};
std::vector<StampedFile> read_file_list(const std::filesystem::path& path);

}  // namespace vantage
