#include "drivers/robot/motion_limits.h"

#include <algorithm>
#include <cmath>

namespace vantage {
namespace {

/// Distances below this are rounding.
constexpr double kTiny = 1e-12;

}  // namespace

void MotionLimiter::reset(double position) {
  position_ = position;
  speed_ = 0;
  limited_ = false;
}

/// The highest speed towards an end at `distance` that can still be braked in steps of the period: after a step at v
/// the way that is left, distance - v dt, must be at least v^2 / 2a.
double MotionLimiter::highest_speed(double distance) const {
  if (distance <= 0) return 0;
  const double dv = limits_.acceleration * period_s_;
  return -dv + std::sqrt(dv * dv + 2 * limits_.acceleration * distance);
}

double MotionLimiter::move(double wanted_speed) {
  const double change = limits_.acceleration * period_s_;
  double speed = std::clamp(wanted_speed, speed_ - change, speed_ + change);
  speed = std::clamp(speed, -limits_.speed, limits_.speed);
  // Outside its range a joint has no way left in that direction.
  const double up = highest_speed(limits_.upper - position_), down = highest_speed(position_ - limits_.lower);
  speed = std::clamp(speed, -down, up);
  position_ += speed * period_s_;
  speed_ = speed;
  return position_;
}

double MotionLimiter::towards(double wanted_position) {
  if (!std::isfinite(wanted_position)) {
    limited_ = true;
    return move(0);
  }
  const double target = std::clamp(wanted_position, limits_.lower, limits_.upper);
  limited_ = target != wanted_position;
  const double distance = target - position_;
  if (std::abs(distance) < kTiny && std::abs(speed_) < kTiny) return position_;
  const double change = limits_.acceleration * period_s_;
  const double last_step = std::abs(distance) / period_s_;  // would arrive exactly
  // Near the target the braking curve allows less than a step: arrive with the last one when it may be braked at once.
  const double fastest = last_step <= change ? last_step : std::min(highest_speed(std::abs(distance)), last_step);
  return move(std::copysign(fastest, distance));
}

double MotionLimiter::at_speed(double wanted_speed) {
  if (!std::isfinite(wanted_speed)) wanted_speed = 0;
  move(wanted_speed);
  const double change = limits_.acceleration * period_s_;
  limited_ = std::abs(speed_ - wanted_speed) > change;
  return position_;
}

}  // namespace vantage
