#pragma once

namespace vantage::sim {

/// A motor with its load and servo, in encoder increments.
struct MotorOptions {
  double position = 0;                    ///< where it stands when switched on, on the machine's own scale
  double lowest = -1e12, highest = 1e12;  ///< mechanical stops
  double most_acceleration = 4e6;         ///< increments/s2 that its torque allows
  double most_speed = 4e5;                ///< increments/s
};

/// Second-order dynamics: the servo's position loop (proportional, with the demand's speed fed forward) commands a
/// speed, the speed loop an acceleration, which the torque bounds. The lag behind a moving demand is the following
/// error that a drive measures.
class DriveMotor {
 public:
  explicit DriveMotor(const MotorOptions& options) : options_(options), position_(options.position) {}

  /// Follows a demanded position that moves with `demand_speed`, for `dt` seconds.
  void follow(double demand, double demand_speed, double dt);
  /// Follows a demanded speed.
  void run(double demand_speed, double dt);
  /// Without current: friction stops it.
  void coast(double dt);
  /// A blocked motor does not turn whatever its servo wants.
  void block(bool blocked) { blocked_ = blocked; }

  double position() const { return position_; }
  double speed() const { return speed_; }

 private:
  void accelerate(double wanted_speed, double dt);

  MotorOptions options_;
  double position_, speed_ = 0;
  bool blocked_ = false;
};

}  // namespace vantage::sim
