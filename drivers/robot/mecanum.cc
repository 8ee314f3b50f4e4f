#include "drivers/robot/mecanum.h"

#include <cmath>

namespace vantage {

WheelValues MecanumKinematics::wheels_of(const BaseTwist& twist) const {
  const double turn = reach_ * twist.turn_rad_s;
  return {(twist.x_m_s - twist.y_m_s - turn) / radius_, (twist.x_m_s + twist.y_m_s + turn) / radius_,
          (twist.x_m_s + twist.y_m_s - turn) / radius_, (twist.x_m_s - twist.y_m_s + turn) / radius_};
}

BaseTwist MecanumKinematics::twist_of(const WheelValues& w) const {
  const double quarter = radius_ / 4;
  return {quarter * (w[0] + w[1] + w[2] + w[3]), quarter * (-w[0] + w[1] + w[2] - w[3]),
          quarter / reach_ * (-w[0] + w[1] - w[2] + w[3])};
}

BasePose advance(const BasePose& pose, const BaseTwist& way) {
  // Exponential of SE(2): s = sin(a)/a and c = (1 - cos a)/a of the angle turned.
  const double a = way.turn_rad_s;
  const bool small = std::abs(a) < 1e-4;  // the series' next terms are below 1e-17
  const double s = small ? 1 - a * a / 6 : std::sin(a) / a;
  const double c = small ? a / 2 - a * a * a / 24 : (1 - std::cos(a)) / a;
  const double x = s * way.x_m_s - c * way.y_m_s, y = c * way.x_m_s + s * way.y_m_s;
  const double cosine = std::cos(pose.heading_rad), sine = std::sin(pose.heading_rad);
  return {pose.x_m + cosine * x - sine * y, pose.y_m + sine * x + cosine * y, pose.heading_rad + a};
}

}  // namespace vantage
