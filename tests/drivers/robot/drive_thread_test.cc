// The loop in its thread, in real time, against drives behind a Unix socket.

#include "drivers/robot/drive_thread.h"

#include <filesystem>
#include <fstream>
#include <string>
#include <thread>

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include "calib/rig.h"
#include "drivers/can/open_can_bus.h"
#include "drivers/robot/cycle_statistics.h"
#include "drivers/sim/drive_service.h"
#include "simulated_robot.h"
#include "tests/allocation_watch.h"

namespace vantage {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::nanoseconds;
using std::chrono::seconds;

/// Short ways to the switches: homing in real time.
DrivesRig quick_rig() {
  DrivesRig rig = *load_rig(VANTAGE_SOURCE_DIR "/calib/rigs/youbot.yaml").drives;
  for (JointRig& joint : rig.joints) {
    const bool upper = joint.upper_rad - joint.zero_rad < joint.zero_rad - joint.lower_rad;
    (upper ? joint.lower_rad : joint.upper_rad) = joint.zero_rad + (upper ? -1.0 : 1.0);
    joint.homing_speed_rad_s = 0.7;  // stops within the way behind the switch
  }
  // A computer that runs many tests at once may hold loop and drives up for a while.
  rig.cycle = milliseconds(50);
  rig.stop_after = milliseconds(2000);
  return rig;
}

class DrivesInRealTime : public testing::Test {
 protected:
  void SetUp() override {
    char folder[] = "/tmp/drives-XXXXXX";
    ASSERT_NE(::mkdtemp(folder), nullptr);
    folder_ = folder;
    const std::string bus = "sim:" + folder_ + "/bus";
    service_ = std::make_unique<sim::DriveService>(bus, rig_, 3);
    bus_ = can::open_can_bus(bus);
    robot_ = std::make_unique<DriveThread>(*bus_, clock_, rig_);
  }
  void TearDown() override {
    robot_.reset();
    service_.reset();
    std::filesystem::remove_all(folder_);
  }
  template <typename Done>
  bool await(Done&& done) {
    for (int i = 0; i < 1000 && !done(); ++i) std::this_thread::sleep_for(milliseconds(10));
    return done();
  }

  DrivesRig rig_ = quick_rig();
  SystemClock clock_;
  std::string folder_;
  std::unique_ptr<sim::DriveService> service_;
  std::unique_ptr<can::CanBus> bus_;
  std::unique_ptr<DriveThread> robot_;
};

TEST_F(DrivesInRealTime, HomesMovesRecordsAFaultAndRecovers) {
  ASSERT_EQ(robot_->request(DriveRequest::kSetUp), "");
  ASSERT_EQ(robot_->request(DriveRequest::kHome), "");
  ASSERT_EQ(robot_->request(DriveRequest::kEnable), "");
  const double goal = 0.5 * (rig_.joints[0].lower_rad + rig_.joints[0].upper_rad);
  const auto arrived = [&] {
    RobotCommand command;
    command.arm = RobotCommand::Arm::kPosition;
    for (std::size_t i = 0; i < 5; ++i) command.joints[i] = 0.5 * (rig_.joints[i].lower_rad + rig_.joints[i].upper_rad);
    command.valid_until = clock_.monotonic() + seconds(5);
    robot_->command(command);
    return std::abs(robot_->state().axis[0].position_rad - goal) < 1e-3;
  };
  EXPECT_TRUE(await(arrived));
  EXPECT_EQ(robot_->fault_text(), "");
  const DriveFigures figures = robot_->figures();
  EXPECT_GT(figures.punctuality.cycles(), 20U);
  EXPECT_GT(figures.cpu_share, 0);
  EXPECT_TRUE(robot_->realtime().missing.empty() == (robot_->realtime().fifo && robot_->realtime().memory_locked));

  // A fault that a joint's drive reports: told over the bus from somebody else's tool.
  const auto tool = can::open_can_bus("sim:" + folder_ + "/bus");
  tool->send(can::make_frame(0x604, {0x2B, 0x00, 0x2F, 0x00, 0x20, 0x32, 0, 0}));  // 2F00 = 0x3220
  EXPECT_TRUE(await([&] { return robot_->state().phase == DrivesPhase::kFault; }));
  EXPECT_TRUE(await([&] { return robot_->recorder().complete(); }));
  const std::string text = robot_->fault_text();
  EXPECT_NE(text.find("joint_4 (node 4): the drive reports a fault"), std::string::npos) << text;
  EXPECT_NE(text.find("under-voltage"), std::string::npos) << text;
  const std::string file = folder_ + "/fault.csv";
  robot_->recorder().write(file);
  std::ifstream csv(file);
  std::string header, line, last;
  std::getline(csv, header);
  EXPECT_EQ(header.substr(0, 40), "time_s,cycle,phase,x_m,y_m,heading_rad,p");
  int lines = 0;
  while (std::getline(csv, line)) last = line, ++lines;
  EXPECT_GT(lines, 60);
  EXPECT_NE(last.find(",3,"), std::string::npos) << last;  // phase: fault

  EXPECT_EQ(robot_->request(DriveRequest::kRecover), "");
  EXPECT_EQ(robot_->request(DriveRequest::kEnable), "");
  EXPECT_EQ(robot_->request(DriveRequest::kDisable), "");
  EXPECT_EQ(robot_->state().phase, DrivesPhase::kReady);
}

TEST_F(DrivesInRealTime, WhatIsOutOfTurnIsRefusedInWords) {
  EXPECT_EQ(robot_->request(DriveRequest::kHome), "homing needs drives that are set up and without power");
  EXPECT_EQ(robot_->request(DriveRequest::kEnable), "switching on needs drives that are set up and without power");
  EXPECT_EQ(robot_->request(DriveRequest::kRecover), "there is no fault to recover from");
  EXPECT_EQ(robot_->request(DriveRequest::kDisable), "");
}

/// In a process of its own: gives all rights away, then asks for real time. Ends with 0 when it is told what is
/// missing.
[[noreturn]] void ask_without_rights() {
  const rlimit none{0, 0};
  ::setrlimit(RLIMIT_RTPRIO, &none);
  ::setrlimit(RLIMIT_MEMLOCK, &none);
  if (::setuid(65534) != 0 && ::geteuid() == 0) std::exit(3);
  const RealtimeState state = enter_realtime(80);
  const auto tells = [&state](const char* words) { return state.missing.find(words) != std::string::npos; };
  std::exit(!state.fifo && tells("no SCHED_FIFO") && tells("LimitRTPRIO=80") &&
                    (state.memory_locked || tells("LimitMEMLOCK"))  // sanitizers make mlockall do nothing
                ? 0
                : 1);
}

TEST(Realtime, WithoutTheRightItSaysWhatIsMissingAndHowToGiveIt) {
  EXPECT_EXIT(ask_without_rights(), testing::ExitedWithCode(0), "");
}

TEST(RobotLoop, AllocatesNothingWhileItMovesNorWhenItFails) {
  if (!AllocationWatch::works()) GTEST_SKIP() << "sanitizers replace operator new";
  SimulatedRobot sim;
  ASSERT_EQ(sim.robot().set_up(), "");
  ASSERT_EQ(sim.robot().home(), "");
  ASSERT_EQ(sim.robot().enable(), "");
  RobotCommand command = sim.command();
  command.arm = RobotCommand::Arm::kPosition;
  command.base = {0.2, 0.1, 0.3};
  FlightRecorder recorder(500, 50);
  LatestValue<RobotState> latest;
  sim.robot().on_cycle([&](const RobotState& state) {
    recorder.record(state);
    latest.write(state);
  });
  const AllocationWatch watch;
  for (int i = 0; i < 1000; ++i) {
    command.joints[0] = 0.001 * i;
    command.valid_until = sim.clock().monotonic() + seconds(1);
    if (i == 700) sim.drive(3).kill();
    sim.robot().cycle(command);
  }
  EXPECT_EQ(watch.count(), 0U);
  EXPECT_EQ(sim.robot().state().phase, DrivesPhase::kFault);
  EXPECT_TRUE(recorder.complete());
}

TEST(LatestValue, AReaderSeesWholeValuesInOrderAndTheLastOne) {
  struct Value {
    std::array<std::uint64_t, 64> all{};
  };
  LatestValue<Value> latest;
  constexpr std::uint64_t kLast = 200'000;
  std::thread writer([&latest] {
    Value value;
    for (std::uint64_t n = 1; n <= kLast; ++n) {
      value.all.fill(n);
      latest.write(value);
    }
  });
  std::uint64_t before = 0;
  Value value;
  while (before < kLast) {
    const bool fresh = latest.read(&value);
    for (const std::uint64_t n : value.all) ASSERT_EQ(n, value.all[0]);
    ASSERT_GE(value.all[0], before);
    ASSERT_TRUE(fresh || value.all[0] == before);
    before = value.all[0];
  }
  writer.join();
  EXPECT_FALSE(latest.read(&value));
}

TEST(CycleStatistics, TellsWhatItWasGiven) {
  CycleStatistics statistics;
  for (int i = 1; i <= 1000; ++i) statistics.add(microseconds(i));
  statistics.add_missed(2);
  EXPECT_EQ(statistics.cycles(), 1000U);
  EXPECT_EQ(statistics.worst(), microseconds(1000));
  EXPECT_EQ(statistics.mean(), nanoseconds(500'500));
  for (const double part : {0.5, 0.9, 0.99}) {
    const double exact = 1000 * part;
    const double told = std::chrono::duration<double, std::micro>(statistics.quantile(part)).count();
    EXPECT_GE(told, exact);
    EXPECT_LE(told, exact * 1.071);
  }
  EXPECT_EQ(to_text(statistics).substr(0, 24), "1000 cycles, 2 missed; l");
  statistics.add(nanoseconds(-5));
  EXPECT_EQ(statistics.worst(), microseconds(1000));
}

}  // namespace
}  // namespace vantage
