#include "drivers/robot/twist_limiter.h"

#include <algorithm>
#include <cmath>

namespace vantage {

BaseTwist TwistLimiter::towards(const BaseTwist& wanted) {
  BaseTwist goal = wanted;
  if (!std::isfinite(goal.x_m_s) || !std::isfinite(goal.y_m_s) || !std::isfinite(goal.turn_rad_s)) goal = {};
  double scale = 1;
  const auto keep_below = [&scale](double value, double limit) {
    if (std::abs(value) > limit) scale = std::min(scale, limit / std::abs(value));
  };
  keep_below(std::hypot(goal.x_m_s, goal.y_m_s), limits_.speed_m_s);
  keep_below(goal.turn_rad_s, limits_.turn_speed_rad_s);
  for (const double wheel : kinematics_.wheels_of(goal)) keep_below(wheel * wheel_radius_m_, limits_.speed_m_s);
  goal = {scale * goal.x_m_s, scale * goal.y_m_s, scale * goal.turn_rad_s};

  const double dx = goal.x_m_s - twist_.x_m_s, dy = goal.y_m_s - twist_.y_m_s,
               dturn = goal.turn_rad_s - twist_.turn_rad_s;
  double part = 1;  // of the change, that this cycle may make
  const double change = std::hypot(dx, dy), most = limits_.acceleration_m_s2 * period_s_;
  if (change > most) part = std::min(part, most / change);
  const double most_turn = limits_.turn_acceleration_rad_s2 * period_s_;
  if (std::abs(dturn) > most_turn) part = std::min(part, most_turn / std::abs(dturn));
  twist_ = {twist_.x_m_s + part * dx, twist_.y_m_s + part * dy, twist_.turn_rad_s + part * dturn};
  limited_ = scale < 1 || part < 1;
  return twist_;
}

}  // namespace vantage
