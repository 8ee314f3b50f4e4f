#include "drivers/sim/drive_motor.h"

#include <algorithm>

namespace vantage::sim {
namespace {

constexpr double kPositionGain = 60;  // 1/s
constexpr double kSpeedGain = 300;    // 1/s
constexpr double kFriction = 0.25;    // of the most acceleration, without current

}  // namespace

void DriveMotor::accelerate(double wanted_speed, double dt) {
  const double wanted = std::clamp(wanted_speed, -options_.most_speed, options_.most_speed);
  const double acceleration =
      std::clamp(kSpeedGain * (wanted - speed_), -options_.most_acceleration, options_.most_acceleration);
  const double before = speed_;
  speed_ += acceleration * dt;
  if (blocked_) speed_ = 0;
  position_ += 0.5 * (before + speed_) * dt;
  if (position_ < options_.lowest || position_ > options_.highest) {
    position_ = std::clamp(position_, options_.lowest, options_.highest);
    speed_ = 0;
  }
}

void DriveMotor::follow(double demand, double demand_speed, double dt) {
  accelerate(demand_speed + kPositionGain * (demand - position_), dt);
}

void DriveMotor::run(double demand_speed, double dt) { accelerate(demand_speed, dt); }

void DriveMotor::coast(double dt) {
  const double loss = kFriction * options_.most_acceleration * dt;
  speed_ -= std::clamp(speed_, -loss, loss);
  position_ = std::clamp(position_ + speed_ * dt, options_.lowest, options_.highest);
}

}  // namespace vantage::sim
