#pragma once

#include <array>

namespace vantage {

/// Motion of the base in its own frame: x forward, y to the left, counter-clockwise.
struct BaseTwist {
  double x_m_s = 0, y_m_s = 0, turn_rad_s = 0;
};

/// The base on the floor, in the frame in which odometry began.
struct BasePose {
  double x_m = 0, y_m = 0, heading_rad = 0;  ///< the heading is not wrapped
};

/// Four numbers, one a wheel: front left, front right, back left, back right. Positive rolls the base forward.
using WheelValues = std::array<double, 4>;

/// Kinematics of a base on four mecanum wheels with rollers at 45 degrees (X arrangement, seen from above).
///
/// With k = (length + width) / 2 and wheels of radius r the speeds are (x -+ y -+ k turn) / r; four wheels for three
/// degrees of freedom, so that odometry is the least-squares solution.
class MecanumKinematics {
 public:
  MecanumKinematics(double wheel_radius_m, double length_m, double width_m)
      : radius_(wheel_radius_m), reach_(0.5 * (length_m + width_m)) {}

  WheelValues wheels_of(const BaseTwist& twist) const;
  /// The twist of wheel speeds, or, from angles turned, the way in the base's frame.
  BaseTwist twist_of(const WheelValues& wheels) const;

 private:
  double radius_, reach_;
};

/// `pose` after the base has moved by `way` (m, m, rad, in its own frame) at constant twist: the exact arc.
BasePose advance(const BasePose& pose, const BaseTwist& way);

}  // namespace vantage
