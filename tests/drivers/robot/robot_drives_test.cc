#include "drivers/robot/robot_drives.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "simulated_robot.h"

namespace vantage {
namespace {

using std::chrono::milliseconds;
using std::chrono::nanoseconds;
using std::chrono::seconds;

constexpr std::size_t kJoints = 5, kAxes = 9;
constexpr double kPeriod = 0.01;

TEST(RobotDrives, NothingMovesBeforeHoming) {
  SimulatedRobot sim;
  EXPECT_EQ(sim.robot().set_up(), "");
  EXPECT_EQ(sim.robot().state().phase, DrivesPhase::kReady);
  EXPECT_EQ(sim.robot().enable(), "joint_1 has not been homed");
}

TEST(RobotDrives, HomingFindsTheTrueAngleOfEveryJoint) {
  SimulatedRobot sim;
  ASSERT_EQ(sim.robot().set_up(), "");
  ASSERT_EQ(sim.robot().home(), "");
  for (std::size_t i = 0; i < kJoints; ++i) {
    EXPECT_TRUE(sim.robot().state().axis[i].homed);
    // One increment of the encoder is 1e-5 to 2.2e-5 rad.
    EXPECT_NEAR(sim.robot().state().axis[i].position_rad, sim.angle(i), 3e-5) << i;
  }
  for (std::size_t i = 0; i < kAxes; ++i) EXPECT_NE(sim.drive(i).state(), can::DriveState::kOperationEnabled);
}

TEST(RobotDrives, ADrivesDataSheetBindsWhatItIsTold) {
  ManualClock clock;
  can::MemoryCanNetwork network(clock);
  const auto bus = network.attach("robot"), drive_bus = network.attach("drives");
  DrivesRig rig = *load_rig(VANTAGE_SOURCE_DIR "/calib/rigs/youbot.yaml").drives;
  rig.joints[2].drive.eds = VANTAGE_SOURCE_DIR "/calib/rigs/simulated_drive.eds";
  sim::DriveRack rack(*drive_bus, clock, sim::drives_of(rig, 1));
  network.on_tick([&rack] { rack.step(); });
  rack.start();
  network.advance_to(milliseconds(100));
  EXPECT_EQ(RobotDrives(*bus, clock, rig).set_up(), "");
  rig.joints[2].acceleration_rad_s2 = 500;  // 4 times that is asked of the quick stop
  EXPECT_EQ(RobotDrives(*bus, clock, rig).set_up(),
            "joint_3 (node 3): writing 127323954 to 6085 (quick-stop deceleration): the drive takes 1 to 50000000");
}

/// A robot that is homed and switched on.
class RunningRobot : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_EQ(sim_.robot().set_up(), "");
    ASSERT_EQ(sim_.robot().home(), "");
    ASSERT_EQ(sim_.robot().enable(), "");
  }
  RobotDrives& robot() { return sim_.robot(); }
  void run(const RobotCommand& command, int cycles) {
    for (int i = 0; i < cycles; ++i) {
      RobotCommand fresh = command;
      fresh.valid_until = sim_.command().valid_until;
      robot().cycle(fresh);
    }
  }
  RobotCommand to(std::array<double, kJoints> angles) {
    RobotCommand command = sim_.command();
    command.arm = RobotCommand::Arm::kPosition;
    std::copy(angles.begin(), angles.end(), command.joints.begin());
    return command;
  }

  SimulatedRobot sim_;
};

TEST_F(RunningRobot, JointsArriveWhereTheyAreSent) {
  const std::array<double, kJoints> goal{0.5, 0.3, -0.8, 1.1, -2.0};
  run(to(goal), 600);
  for (std::size_t i = 0; i < kJoints; ++i) {
    EXPECT_NEAR(sim_.angle(i), goal[i], 1e-4) << i;
    EXPECT_NEAR(robot().state().axis[i].position_rad, goal[i], 1e-4) << i;
    EXPECT_FALSE(robot().state().axis[i].limited);
  }
  EXPECT_EQ(robot().fault_text(), "");
}

TEST_F(RunningRobot, TheFollowingErrorIsTheServosLagAndNotTheLoopsOwn) {
  run(to({0, 0, 0, 0, 0}), 500);
  RobotCommand command = sim_.command();
  command.arm = RobotCommand::Arm::kSpeed;
  command.joints.fill(0.5);
  run(command, 100);
  // A servo that feeds the speed forward lags by next to nothing, and this bus by a tick of 1 ms: 5e-4 rad. A cycle
  // more or less would be 5e-3 rad.
  for (std::size_t i = 0; i < kJoints; ++i) EXPECT_NEAR(robot().state().axis[i].following_error_rad, 0, 6e-4) << i;
}

TEST_F(RunningRobot, SwitchingOnMovesNothing) {
  std::array<double, kAxes> before{};
  for (std::size_t i = 0; i < kAxes; ++i) before[i] = sim_.angle(i);
  run({}, 100);
  for (std::size_t i = 0; i < kAxes; ++i) EXPECT_NEAR(sim_.angle(i), before[i], 1e-4) << i;
}

TEST_F(RunningRobot, WhateverIsAskedSetPointsOnTheBusAndMotorsKeepTheLimits) {
  const unsigned seed = 11;
  RecordProperty("seed", static_cast<int>(seed));
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> wild(-20, 20);
  run(to({0, 0, 0, 0, 0}), 500);
  std::array<double, kJoints> sent{};  // what the bus carried last
  sim_.network().set_witness([&](const can::CanFrame& frame) {
    if (frame.id <= 0x200 || frame.id > 0x200 + kJoints) return;
    const JointRig& joint = sim_.rig().joints[frame.id - 0x201];
    const auto increments = can::get_number(std::span(frame.data).subspan(2, 4), true);
    sent[frame.id - 0x201] = joint.zero_rad + static_cast<double>(increments) / joint.drive.increments_per_rad();
  });
  run(to({0, 0, 0, 0, 0}), 2);
  std::array<double, kJoints> before = sent, speed_before{}, truth_before{};
  for (std::size_t i = 0; i < kJoints; ++i) truth_before[i] = sim_.angle(i);
  RobotCommand command = sim_.command();
  for (int cycle = 0; cycle < 6000; ++cycle) {
    if (cycle % 37 == 0) {
      command.arm = cycle % 2 == 0 ? RobotCommand::Arm::kPosition : RobotCommand::Arm::kSpeed;
      for (double& joint : command.joints) joint = wild(random);
      if (cycle % 5 == 0) command.joints[2] = std::nan("");
      command.base = {wild(random), wild(random), wild(random)};
    }
    run(command, 1);
    for (std::size_t i = 0; i < kJoints; ++i) {
      const JointRig& joint = sim_.rig().joints[i];
      const double increment = 1 / std::abs(joint.drive.increments_per_rad());  // set points are rounded to it
      const double speed = (sent[i] - before[i]) / kPeriod;
      ASSERT_LE(std::abs(speed), joint.speed_rad_s + increment / kPeriod) << i;
      ASSERT_LE(std::abs(speed - speed_before[i]) / kPeriod,
                joint.acceleration_rad_s2 + 2 * increment / (kPeriod * kPeriod))
          << i;
      const double distance = speed > 0 ? joint.upper_rad - sent[i] : sent[i] - joint.lower_rad;
      ASSERT_GE(distance, -increment) << i;
      // speed <= sqrt(2 a distance), with what rounding does to both.
      const double sure_speed = std::max(std::abs(speed) - increment / kPeriod, 0.0);
      ASSERT_LE(sure_speed * sure_speed / (2 * joint.acceleration_rad_s2), distance + increment) << i;
      before[i] = sent[i];
      speed_before[i] = speed;
      // And the motor that follows them.
      const double angle = sim_.angle(i);
      ASSERT_LE(std::abs(angle - std::exchange(truth_before[i], angle)) / kPeriod, joint.speed_rad_s * 1.02) << i;
      ASSERT_GE(angle, joint.lower_rad - 1e-3) << i;
      ASSERT_LE(angle, joint.upper_rad + 1e-3) << i;
    }
  }
  EXPECT_EQ(robot().fault_text(), "");
}

TEST_F(RunningRobot, TheBaseDrivesTheArcThatOdometryTells) {
  run(to({0, 0, 0, 0, 0}), 500);
  const BasePose start = robot().state().base;
  RobotCommand command = sim_.command();
  command.base = {0.3, 0.1, 0.4};
  // The truth from the motors, in steps of a millisecond, as the drives turned.
  const BaseRig& base = *sim_.rig().base;
  const MecanumKinematics kinematics(base.wheel_radius_m, base.length_m, base.width_m);
  BasePose truth = start;
  WheelValues wheels{};
  for (std::size_t w = 0; w < 4; ++w) wheels[w] = sim_.angle(kJoints + w);
  sim_.network().on_tick([&] {
    WheelValues moved{};
    for (std::size_t w = 0; w < 4; ++w)
      moved[w] = sim_.angle(kJoints + w) - std::exchange(wheels[w], sim_.angle(kJoints + w));
    truth = advance(truth, kinematics.twist_of(moved));
  });
  run(command, 500);
  run({}, 200);
  EXPECT_NEAR(robot().state().base.x_m, truth.x_m, 1e-3);
  EXPECT_NEAR(robot().state().base.y_m, truth.y_m, 1e-3);
  EXPECT_NEAR(robot().state().base.heading_rad, truth.heading_rad, 1e-3);
  EXPECT_NEAR(robot().state().base.heading_rad - start.heading_rad, 0.4 * 5, 0.1);  // five seconds, less the ramps
  EXPECT_NEAR(robot().state().base_speed.x_m_s, 0, 1e-6);
}

TEST_F(RunningRobot, AStaleCommandStopsBaseAndArm) {
  run(to({0, 0, 0, 0, 0}), 500);
  RobotCommand command = sim_.command();
  command.arm = RobotCommand::Arm::kSpeed;
  command.joints.fill(0.3);
  command.base = {0.5, 0, 0};
  command.valid_until = sim_.clock().monotonic() + milliseconds(500);
  for (int i = 0; i < 200; ++i) robot().cycle(command);
  EXPECT_NEAR(robot().state().base_speed.x_m_s, 0, 1e-6);
  for (std::size_t i = 0; i < kJoints; ++i) EXPECT_NEAR(robot().state().axis[i].speed_rad_s, 0, 1e-6);
  EXPECT_EQ(robot().state().phase, DrivesPhase::kEnabled);
}

/// Milliseconds until every motor stands, watched without the robot's cycles.
double time_to_standstill_ms(SimulatedRobot& sim) {
  const nanoseconds start = sim.clock().monotonic();
  const auto moving = [&sim] {
    for (std::size_t i = 0; i < kAxes; ++i) {
      if (std::abs(sim.drive(i).motor().speed()) > 100) return true;
    }
    return false;
  };
  while (moving() && sim.clock().monotonic() - start < seconds(5)) sim.pass(milliseconds(1));
  return std::chrono::duration<double, std::milli>(sim.clock().monotonic() - start).count();
}

TEST_F(RunningRobot, DrivesStopByThemselvesWhenTheLoopStalls) {
  run(to({0, 0, 0, 0, 0}), 500);
  RobotCommand command = sim_.command();
  command.arm = RobotCommand::Arm::kSpeed;
  command.joints.fill(1.5);
  command.base = {0.8, 0, 0};
  run(command, 90);
  ASSERT_GT(std::abs(robot().state().axis[0].speed_rad_s), 1.0);
  EXPECT_LT(time_to_standstill_ms(sim_), 300);
  for (std::size_t i = 0; i < kAxes; ++i) EXPECT_EQ(sim_.drive(i).state(), can::DriveState::kQuickStopActive) << i;
  // The loop comes back, sees what has happened, and holds everything until it is told to recover.
  run(command, 50);
  EXPECT_EQ(robot().state().phase, DrivesPhase::kFault);
  EXPECT_NE(robot().fault_text().find("loop stood still for 0."), std::string::npos) << robot().fault_text();
  EXPECT_EQ(robot().recover(), "");
  EXPECT_EQ(robot().enable(), "");
  run(to({0.1, 0, 0, 0, 0}), 500);
  EXPECT_NEAR(sim_.angle(0), 0.1, 1e-3);
}

TEST_F(RunningRobot, AKilledDriveStopsAllAndIsNamed) {
  RobotCommand command = sim_.command();
  command.base = {0.5, 0, 0};
  run(command, 100);
  sim_.drive(7).kill();
  int cycles = 0;
  while (robot().state().phase != DrivesPhase::kFault && cycles < 100) run(command, 1), ++cycles;
  EXPECT_LT(cycles, 10);  // process data miss three SYNCs
  EXPECT_NE(robot().fault_text().find("back_left (node 8): sent no process data"), std::string::npos)
      << robot().fault_text();
  run(command, 60);
  for (std::size_t i = 0; i < kAxes; ++i) {
    if (i != 7) {
      EXPECT_EQ(sim_.drive(i).state(), can::DriveState::kQuickStopActive) << i;
    }
  }
  EXPECT_NE(robot().recover().find("back_left (node 8)"), std::string::npos);
}

TEST_F(RunningRobot, AFaultedDriveIsNamedWithItsErrorAndCanBeReset) {
  run({}, 10);
  sim_.drive(2).dictionary().write(sim::kTripObject, 0x4310);
  run({}, 10);
  ASSERT_EQ(robot().state().phase, DrivesPhase::kFault);
  const std::string text = robot().fault_text();
  for (const char* part : {"joint_3 (node 3)", "the drive reports a fault", "603F", "0x4310", "too hot"}) {
    EXPECT_NE(text.find(part), std::string::npos) << text;
  }
  EXPECT_EQ(robot().recover(), "");
  EXPECT_EQ(robot().enable(), "");
}

TEST_F(RunningRobot, ABlockedJointIsAFollowingError) {
  run(to({0, 0, 0, 0, 0}), 500);
  sim_.drive(1).dictionary().write(sim::kBlockObject, 1);
  run(to({0, 0.8, 0, 0, 0}), 100);
  EXPECT_EQ(robot().state().phase, DrivesPhase::kFault);
  EXPECT_NE(robot().fault_text().find("joint_2 (node 2): following error"), std::string::npos) << robot().fault_text();
}

TEST_F(RunningRobot, ABlockedWheelIsNoticed) {
  sim_.drive(5).dictionary().write(sim::kBlockObject, 1);
  RobotCommand command = sim_.command();
  command.base = {0.5, 0, 0};
  run(command, 150);
  EXPECT_NE(robot().fault_text().find("front_left (node 6): following error"), std::string::npos)
      << robot().fault_text();
}

TEST_F(RunningRobot, ADriveThatDoesNotObeyTheQuickStopLosesItsPower) {
  RobotCommand command = sim_.command();
  command.base = {0.5, 0, 0};
  run(command, 150);
  sim_.drive(5).dictionary().set(can::objects::kQuickStopDeceleration, 1000);  // it would roll for minutes
  sim_.drive(0).dictionary().write(sim::kTripObject, 0x4310);
  run(command, 90);
  EXPECT_EQ(sim_.drive(5).state(), can::DriveState::kQuickStopActive);
  run(command, 30);
  EXPECT_EQ(sim_.drive(5).state(), can::DriveState::kSwitchOnDisabled);
  EXPECT_EQ(sim_.drive(6).state(), can::DriveState::kQuickStopActive);  // it stands, and holds
}

TEST_F(RunningRobot, ADriveThatStartsAnewHasToBeHomedAgain) {
  sim_.network().inject(can::make_frame(0x000, {0x81, 4}));  // NMT reset of node 4
  run({}, 20);
  EXPECT_NE(robot().fault_text().find("joint_4 (node 4): has started anew"), std::string::npos) << robot().fault_text();
  sim_.pass(milliseconds(200));
  EXPECT_EQ(robot().recover(), "");
  EXPECT_EQ(robot().enable(), "joint_4 has not been homed");
  EXPECT_EQ(robot().home(), "");
  EXPECT_EQ(robot().enable(), "");
}

TEST_F(RunningRobot, AFullTransmitQueueIsAFaultNotARetry) {
  sim_.network().set_transmit_queue(4);
  run({}, 5);
  EXPECT_EQ(robot().state().phase, DrivesPhase::kFault);
  EXPECT_NE(robot().fault_text().find("transmit queue is full"), std::string::npos) << robot().fault_text();
}

TEST_F(RunningRobot, TheInterfaceMayGoDownAndComeBack) {
  RobotCommand command = sim_.command();
  command.base = {0.5, 0, 0};
  run(command, 100);
  sim_.network().set_down(true);
  run(command, 5);
  EXPECT_NE(robot().fault_text().find("set down"), std::string::npos) << robot().fault_text();
  EXPECT_LT(time_to_standstill_ms(sim_), 300);
  sim_.network().set_down(false);
  EXPECT_EQ(robot().recover(), "");
  EXPECT_EQ(robot().enable(), "");
}

TEST_F(RunningRobot, BusOffStopsRestartsAndSetsEveryNodeUpAgain) {
  can::CanFrame error;
  error.error = true;
  error.size = 8;
  error.id = 0x40;  // CAN_ERR_BUSOFF
  sim_.network().inject(error);
  run({}, 2);
  EXPECT_NE(robot().fault_text().find("bus-off"), std::string::npos) << robot().fault_text();
  // The controller answers the restart with an error frame of its own.
  sim_.network().on_tick([&, done = false]() mutable {
    if (done || sim_.network().restarts_asked() == 0) return;
    done = true;
    can::CanFrame restarted = error;
    restarted.id = 0x100;  // CAN_ERR_RESTARTED
    sim_.network().inject(restarted);
  });
  sim_.drive(3).dictionary().set(can::objects::kCyclePeriod, 99);  // what a drive may have lost meanwhile
  EXPECT_EQ(robot().recover(), "");
  EXPECT_EQ(sim_.network().restarts_asked(), 1);
  EXPECT_EQ(sim_.drive(3).dictionary().get(can::objects::kCyclePeriod), 10);
  EXPECT_EQ(robot().enable(), "");
}

TEST_F(RunningRobot, EveryCycleSendsOneSetPointAnAxisThenOneSync) {
  std::vector<std::uint32_t> sent;
  sim_.network().set_witness([&sent](const can::CanFrame& frame) {
    if ((frame.id & 0x780) == 0x200 || frame.id == can::kSyncId) sent.push_back(frame.id);
  });
  run({}, 3);
  ASSERT_EQ(sent.size(), 3 * (kAxes + 1));
  for (std::size_t i = 0; i < sent.size(); ++i) {
    EXPECT_EQ(sent[i], i % 10 == 9 ? can::kSyncId : 0x201 + i % 10);
  }
}

}  // namespace
}  // namespace vantage
