#include "onboard/tracking/trajectory_error.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "onboard/tracking/similarity.h"

namespace vantage::tracking {
namespace {

double rmse(std::span<const Eigen::Vector3d> estimate, std::span<const Eigen::Vector3d> truth, bool with_scale,
            double* scale) {
  const Similarity S = fit_similarity(estimate, truth, with_scale);
  double sum = 0;
  for (std::size_t i = 0; i < truth.size(); ++i) sum += (S * estimate[i] - truth[i]).squaredNorm();
  if (scale != nullptr) *scale = S.scale;
  return std::sqrt(sum / static_cast<double>(truth.size()));
}

}  // namespace

TrajectoryError trajectory_error(const std::vector<StampedPose>& estimate, const std::vector<StampedPose>& truth,
                                 bool with_scale, double window_s, std::size_t least_poses) {
  TrajectoryError error;
  std::vector<Eigen::Vector3d> a, b;
  std::vector<double> times;
  for (const StampedPose& pose : estimate) {
    const StampedPose* known = nearest_pose(truth, pose.time_s);
    if (known == nullptr) continue;
    a.push_back(pose.T_world_camera.translation());
    b.push_back(known->T_world_camera.translation());
    times.push_back(pose.time_s);
  }
  error.poses = a.size();
  if (a.size() < 3) return error;
  for (std::size_t i = 1; i < b.size(); ++i) error.path_m += (b[i] - b[i - 1]).norm();
  error.rmse_m = rmse(a, b, with_scale, &error.scale);
  if (!(window_s > 0)) return error;
  int windows = 0;
  for (double begin = times.front(); begin + window_s <= times.back() + window_s / 100; begin += window_s / 4) {
    const auto from = std::lower_bound(times.begin(), times.end(), begin) - times.begin();
    const auto to = std::upper_bound(times.begin(), times.end(), begin + window_s) - times.begin();
    const auto first = static_cast<std::size_t>(from), count = static_cast<std::size_t>(to - from);
    if (count < std::max<std::size_t>(3, least_poses)) continue;
    const double window =
        rmse(std::span(a).subspan(first, count), std::span(b).subspan(first, count), with_scale, nullptr);
    error.worst_window_m = std::max(error.worst_window_m, window);
    error.mean_window_m += window;
    ++windows;
  }
  if (windows > 0) error.mean_window_m /= windows;
  return error;
}

}  // namespace vantage::tracking
