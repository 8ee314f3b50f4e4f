#include "onboard/executive/free_flight.h"

#include <algorithm>

namespace vantage {
namespace {

constexpr double kPeakOverMean = 1.5;  // of the speed of s(t) = 3t^2 - 2t^3, at its middle

}  // namespace

FreeFlight::FreeFlight(const Eigen::Isometry3d& from, const Eigen::Isometry3d& to, const FlightLimits& limits)
    : from_(from), to_(to) {
  const double distance = (to.translation() - from.translation()).norm();
  const double angle = Eigen::AngleAxisd(from.linear().transpose() * to.linear()).angle();
  duration_s_ = kPeakOverMean * std::max(distance / limits.linear_speed_m_s, angle / limits.angular_speed_rad_s);
}

Eigen::Isometry3d FreeFlight::pose_at(double time_s) const {
  if (time_s >= duration_s_) return to_;
  const double t = std::max(0.0, time_s / duration_s_);
  const double s = t * t * (3 - 2 * t);
  const Eigen::Quaterniond turned = Eigen::Quaterniond(from_.linear()).slerp(s, Eigen::Quaterniond(to_.linear()));
  return Eigen::Translation3d((1 - s) * from_.translation() + s * to_.translation()) * turned;
}

}  // namespace vantage
