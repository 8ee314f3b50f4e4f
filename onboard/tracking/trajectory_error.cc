#include "onboard/tracking/trajectory_error.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "onboard/tracking/similarity.h"

namespace vantage::tracking {
namespace {

constexpr double kSameTime_s = 1e-3;

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
                                 bool with_scale, std::size_t window_frames) {
  TrajectoryError error;
  std::vector<Eigen::Vector3d> a, b;
  std::vector<std::size_t> numbers;  // of the truth's pose
  std::size_t j = 0;
  for (const StampedPose& pose : estimate) {
    while (j < truth.size() && truth[j].time_s < pose.time_s - kSameTime_s) ++j;
    if (j == truth.size()) break;
    if (std::abs(truth[j].time_s - pose.time_s) > kSameTime_s) continue;
    a.push_back(pose.T_world_camera.translation());
    b.push_back(truth[j].T_world_camera.translation());
    numbers.push_back(j);
  }
  error.poses = a.size();
  if (a.size() < 3) return error;
  for (std::size_t i = 1; i < b.size(); ++i) error.path_m += (b[i] - b[i - 1]).norm();
  error.rmse_m = rmse(a, b, with_scale, &error.scale);
  int windows = 0;
  for (std::size_t first = 0; first + window_frames <= truth.size();
       first += std::max<std::size_t>(1, window_frames / 4)) {
    const auto from = std::lower_bound(numbers.begin(), numbers.end(), first) - numbers.begin();
    const auto to = std::lower_bound(numbers.begin(), numbers.end(), first + window_frames) - numbers.begin();
    const auto count = static_cast<std::size_t>(to - from);
    if (2 * count < window_frames) continue;
    const auto offset = static_cast<std::size_t>(from);
    const double window =
        rmse(std::span(a).subspan(offset, count), std::span(b).subspan(offset, count), with_scale, nullptr);
    error.worst_window_m = std::max(error.worst_window_m, window);
    error.mean_window_m += window;
    ++windows;
  }
  if (windows > 0) error.mean_window_m /= windows;
  return error;
}

}  // namespace vantage::tracking
