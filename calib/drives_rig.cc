#include "calib/drives_rig.h"

#include <cmath>
#include <set>

namespace vantage {
namespace {

constexpr std::int64_t kMostNode = 126;  // 127 is this computer's
constexpr std::int64_t kMostEncoder = 1'000'000;
constexpr double kMostIncrements = 1e9;  // positions are 32-bit numbers
constexpr int kMostJoints = 12;

double read_positive(YamlMap& map, std::string_view key, Quantity kind) {
  const double value = map.quantity(key, kind);
  if (value <= 0) map.fail(key, "must be positive");
  return value;
}

std::chrono::milliseconds read_milliseconds(YamlMap& map, std::string_view key, double least_s, double most_s) {
  const double value = map.quantity(key, Quantity::kDuration);
  const double milliseconds = value * 1e3;
  if (value < least_s || value > most_s || std::abs(milliseconds - std::round(milliseconds)) > 1e-9) {
    map.fail(key, "expected whole milliseconds from " + yaml_quantity(least_s, Quantity::kDuration) + " to " +
                      yaml_quantity(most_s, Quantity::kDuration));
  }
  return std::chrono::milliseconds(std::lround(milliseconds));
}

DriveRig read_drive(YamlMap& map, const std::string& name, std::set<int>* nodes) {
  DriveRig drive;
  drive.name = name;
  const std::int64_t node = map.integer("node");
  if (node < 1 || node > kMostNode) map.fail("node", "expected 1 to " + std::to_string(kMostNode));
  drive.node = static_cast<int>(node);
  if (!nodes->insert(drive.node).second) map.fail("node", "another drive has it already");
  const std::vector<double> gear = map.numbers("gear", 2);
  if (!(gear[0] > 0 && gear[1] > 0)) map.fail("gear", "expected [motor turns, output turns], both positive");
  drive.motor_turns = gear[0];
  drive.output_turns = gear[1];
  const std::int64_t encoder = map.integer("encoder");
  if (encoder < 1 || encoder > kMostEncoder) {
    map.fail("encoder", "expected 1 to " + std::to_string(kMostEncoder) + " increments a turn");
  }
  drive.encoder = static_cast<int>(encoder);
  const std::int64_t sign = map.integer("sign");
  if (sign != 1 && sign != -1) map.fail("sign", "expected 1 or -1");
  drive.sign = static_cast<int>(sign);
  if (map.has("eds")) drive.eds = map.text("eds");
  return drive;
}

JointRig read_joint(YamlMap map, const std::string& name, std::set<int>* nodes) {
  JointRig joint;
  joint.drive = read_drive(map, name, nodes);
  joint.zero_rad = map.quantity("zero", Quantity::kAngle);
  const std::vector<double> range = map.quantities("range", Quantity::kAngle, 2);
  joint.lower_rad = range[0];
  joint.upper_rad = range[1];
  if (!(joint.lower_rad < joint.upper_rad)) map.fail("range", "expected [lower, upper]");
  joint.speed_rad_s = read_positive(map, "speed", Quantity::kAngularSpeed);
  joint.acceleration_rad_s2 = read_positive(map, "acceleration", Quantity::kAngularAcceleration);
  joint.following_error_rad = read_positive(map, "following_error", Quantity::kAngle);
  joint.homing_speed_rad_s = read_positive(map, "homing_speed", Quantity::kAngularSpeed);
  // The switch closes at the end that the zero is nearer to.
  const bool upper_end = std::abs(joint.zero_rad - joint.upper_rad) < std::abs(joint.zero_rad - joint.lower_rad);
  const double gap = std::min(std::abs(joint.zero_rad - joint.upper_rad), std::abs(joint.zero_rad - joint.lower_rad));
  if (gap > 0.1 * (joint.upper_rad - joint.lower_rad)) map.fail("zero", "lies far from both ends of the range");
  joint.homing_method = upper_end == (joint.drive.sign > 0) ? 18 : 17;
  const double reach = std::max(std::abs(joint.lower_rad - joint.zero_rad), std::abs(joint.upper_rad - joint.zero_rad));
  if (std::abs(joint.drive.increments_per_rad()) * reach > kMostIncrements) {
    map.fail("gear", "the range has more increments than a drive can count");
  }
  map.finish();
  return joint;
}

BaseRig read_base(YamlMap map, std::set<int>* nodes) {
  BaseRig base;
  base.wheel_radius_m = read_positive(map, "wheel_radius", Quantity::kLength);
  base.length_m = read_positive(map, "length", Quantity::kLength);
  base.width_m = read_positive(map, "width", Quantity::kLength);
  base.speed_m_s = read_positive(map, "speed", Quantity::kSpeed);
  base.turn_speed_rad_s = read_positive(map, "turn_speed", Quantity::kAngularSpeed);
  base.acceleration_m_s2 = read_positive(map, "acceleration", Quantity::kAcceleration);
  base.turn_acceleration_rad_s2 = read_positive(map, "turn_acceleration", Quantity::kAngularAcceleration);
  base.speed_error_rad_s = read_positive(map, "wheel_speed_error", Quantity::kAngularSpeed);
  constexpr std::array kWheels{"front_left", "front_right", "back_left", "back_right"};
  for (std::size_t i = 0; i < kWheels.size(); ++i) {
    YamlMap wheel = map.map(kWheels[i]);
    base.wheels[i] = read_drive(wheel, kWheels[i], nodes);
    wheel.finish();
  }
  map.finish();
  return base;
}

}  // namespace

double DriveRig::increments_per_rad() const { return sign * encoder * motor_turns / output_turns / (2 * M_PI); }

DrivesRig read_drives(YamlMap map) {
  DrivesRig drives;
  std::set<int> nodes;
  drives.cycle = read_milliseconds(map, "cycle", 0.001, 0.1);
  drives.heartbeat = read_milliseconds(map, "heartbeat", 0.005, 1);
  drives.stop_after = read_milliseconds(map, "stop_after", 0.01, 2);
  if (drives.stop_after < 2 * drives.heartbeat) map.fail("stop_after", "must be at least two heartbeats");
  if (map.has("arm")) {
    YamlMap arm = map.map("arm");
    for (int i = 1; i <= kMostJoints && arm.has("joint_" + std::to_string(i)); ++i) {
      const std::string name = "joint_" + std::to_string(i);
      drives.joints.push_back(read_joint(arm.map(name), name, &nodes));
    }
    if (drives.joints.empty()) map.fail("arm", "expected joint_1, joint_2 and so on, from the base to the wrist");
    arm.finish();
  }
  if (map.has("base")) drives.base = read_base(map.map("base"), &nodes);
  if (drives.axes() == 0) map.fail("arm", "expected an arm, a base or both");
  map.finish();
  return drives;
}

}  // namespace vantage
