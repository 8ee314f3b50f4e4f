#pragma once

namespace vantage {

/// What a joint may do. Angles in rad.
struct MotionLimits {
  double lower = 0, upper = 0;
  double speed = 0;         ///< rad/s, positive
  double acceleration = 0;  ///< rad/s2, positive
};

/// Turns what a caller wants of a joint into set points that keep its limits, one a cycle.
///
/// Whatever is asked for: the speed stays within `speed`, its change within `acceleration`, the position within
/// [lower, upper], and near an end the speed at most sqrt(2 * acceleration * distance), so that the joint can always
/// still stop. A joint that starts outside its range may only move towards it. Allocates nothing.
class MotionLimiter {
 public:
  /// \pre limits make sense; `period_s` is the time between set points, positive.
  MotionLimiter(const MotionLimits& limits, double period_s) : limits_(limits), period_s_(period_s) {}

  /// Starts anew at a position, at rest.
  void reset(double position);

  /// The set point of the next cycle on the way to a position: as fast as the limits allow, at rest there.
  double towards(double wanted_position);
  /// The set point of the next cycle at a speed.
  double at_speed(double wanted_speed);

  double position() const { return position_; }
  double speed() const { return speed_; }
  /// True when the last wish was not granted as it was: outside the range, or too fast.
  bool limited() const { return limited_; }

 private:
  double highest_speed(double distance) const;
  double move(double wanted_speed);

  MotionLimits limits_;
  double period_s_;
  double position_ = 0, speed_ = 0;
  bool limited_ = false;
};

}  // namespace vantage
