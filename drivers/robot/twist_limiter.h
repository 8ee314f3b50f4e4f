#pragma once

#include "drivers/robot/mecanum.h"

namespace vantage {

struct TwistLimits {
  double speed_m_s = 0;  ///< of the base, and of every wheel's rim
  double turn_speed_rad_s = 0;
  double acceleration_m_s2 = 0, turn_acceleration_rad_s2 = 0;
};

/// Turns a wanted motion of the base into one that keeps its limits, one a cycle. Too fast a wish is slowed as a whole,
/// so that the base keeps its direction.
class TwistLimiter {
 public:
  TwistLimiter(const TwistLimits& limits, const MecanumKinematics& kinematics, double wheel_radius_m, double period_s)
      : limits_(limits), kinematics_(kinematics), wheel_radius_m_(wheel_radius_m), period_s_(period_s) {}

  void reset() { twist_ = {}; }
  BaseTwist towards(const BaseTwist& wanted);
  bool limited() const { return limited_; }

 private:
  TwistLimits limits_;
  MecanumKinematics kinematics_;
  double wheel_radius_m_, period_s_;
  BaseTwist twist_;
  bool limited_ = false;
};

}  // namespace vantage
