#pragma once

#include <Eigen/Geometry>

namespace vantage {

struct FlightLimits {
  double linear_speed_m_s = 0;
  double angular_speed_rad_s = 0;
};

/// Straight flight of a free camera from one pose to another: position on the line, orientation by the shortest turn,
/// both by the same cubic s(t) = 3t^2 - 2t^3, so that it starts and ends at rest and neither speed limit is passed.
///
/// It does not look for obstacles: only the simulator's camera flies so.
class FreeFlight {
 public:
  /// \pre both poses are rigid (is_rigid), both limits positive.
  FreeFlight(const Eigen::Isometry3d& from, const Eigen::Isometry3d& to, const FlightLimits& limits);

  double duration_s() const { return duration_s_; }
  /// T_world_camera `time_s` after the start; before it the first pose, after the end exactly the goal.
  Eigen::Isometry3d pose_at(double time_s) const;

 private:
  Eigen::Isometry3d from_, to_;
  double duration_s_ = 0;
};

}  // namespace vantage
