#include "drivers/sim/drive_rack.h"

#include <cmath>
#include <random>

namespace vantage::sim {
namespace {

constexpr double kOvertravel = 0.06;      // rad from the end of a joint's range to its mechanical stop, past the switch
constexpr double kMostAcceleration = 60;  // rad/s2 that a joint's motor can give
constexpr double kMostWheelAcceleration = 300;
constexpr std::chrono::milliseconds kTick{5};

std::vector<std::uint32_t> identifiers_for(const std::vector<SimDriveOptions>& drives) {
  std::vector<std::uint32_t> ids{can::kNmtId, can::kSyncId};
  for (const SimDriveOptions& drive : drives) {
    ids.push_back(0x600U + drive.node);
    for (int pdo = 1; pdo <= 4; ++pdo) ids.push_back(can::pdo_id(can::PdoDirection::kToDrive, pdo, drive.node));
  }
  for (std::uint8_t node = 1; node <= can::kLastNode; ++node) ids.push_back(can::heartbeat_id(node));
  return ids;
}

}  // namespace

std::vector<SimDriveOptions> drives_of(const DrivesRig& rig, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> middle(0.35, 0.65);
  std::vector<SimDriveOptions> drives;
  for (const JointRig& joint : rig.joints) {
    SimDriveOptions drive;
    drive.node = static_cast<std::uint8_t>(joint.drive.node);
    drive.label = joint.drive.name;
    const double scale = joint.drive.increments_per_rad();
    // The machine's scale begins at the limit switch.
    const auto place = [&](double angle) { return (angle - joint.zero_rad) * scale; };
    const double low = std::min(joint.lower_rad, joint.zero_rad) - kOvertravel;
    const double high = std::max(joint.upper_rad, joint.zero_rad) + kOvertravel;
    drive.motor.lowest = std::min(place(low), place(high));
    drive.motor.highest = std::max(place(low), place(high));
    drive.motor.position = place(joint.lower_rad + middle(random) * (joint.upper_rad - joint.lower_rad));
    drive.motor.most_acceleration = kMostAcceleration * std::abs(scale);
    drive.motor.most_speed = 3 * joint.speed_rad_s * std::abs(scale);
    (joint.homing_method == 17 ? drive.switches.negative : drive.switches.positive) = 0;
    drives.push_back(drive);
  }
  if (rig.base) {
    for (const DriveRig& wheel : rig.base->wheels) {
      SimDriveOptions drive;
      drive.node = static_cast<std::uint8_t>(wheel.node);
      drive.label = wheel.name;
      drive.motor.most_acceleration = kMostWheelAcceleration * std::abs(wheel.increments_per_rad());
      drive.motor.most_speed =
          3 * rig.base->speed_m_s / rig.base->wheel_radius_m * std::abs(wheel.increments_per_rad());
      drives.push_back(drive);
    }
  }
  return drives;
}

DriveRack::DriveRack(can::CanBus& bus, const Clock& clock, const std::vector<SimDriveOptions>& drives)
    : bus_(bus), clock_(clock) {
  bus_.accept_only(identifiers_for(drives));
  for (const SimDriveOptions& drive : drives) {
    drives_.push_back(std::make_unique<SimDrive>(drive, clock.monotonic()));
  }
}

void DriveRack::start() {
  for (const auto& drive : drives_) drive->start(bus_);
}

void DriveRack::step() {
  const std::chrono::nanoseconds now = clock_.monotonic();
  for (const auto& drive : drives_) drive->advance(now, bus_);
  can::CanFrame frame;
  while (bus_.receive(&frame) == can::ReceiveResult::kFrame) {
    for (const auto& drive : drives_) drive->receive(frame, bus_);
  }
}

void DriveRack::serve(const std::atomic<bool>& stop) {
  while (!stop) {
    bus_.wait_until(clock_.monotonic() + kTick);
    step();
  }
}

}  // namespace vantage::sim
