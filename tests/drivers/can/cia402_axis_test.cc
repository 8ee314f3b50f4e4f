#include "drivers/can/cia402_axis.h"

#include <array>
#include <cmath>

#include <gtest/gtest.h>

#include "drivers/can/drive_setup.h"
#include "simulated_node.h"

namespace vantage::can {
namespace {

using std::chrono::milliseconds;
using std::chrono::nanoseconds;
using std::chrono::seconds;

// Statuswords by the table of CiA 402.
constexpr std::uint16_t kNotReady = 0x0000, kDisabled = 0x0240, kReady = 0x0231, kSwitchedOn = 0x0233,
                        kEnabled = 0x0237, kQuickStopped = 0x0217, kReaction = 0x020F, kFaulted = 0x0208;

TEST(DriveStates, AreReadFromEveryStatuswordOfTheProfile) {
  EXPECT_EQ(drive_state(kNotReady), DriveState::kNotReady);
  EXPECT_EQ(drive_state(kDisabled), DriveState::kSwitchOnDisabled);
  EXPECT_EQ(drive_state(kReady), DriveState::kReadyToSwitchOn);
  EXPECT_EQ(drive_state(kSwitchedOn), DriveState::kSwitchedOn);
  EXPECT_EQ(drive_state(kEnabled), DriveState::kOperationEnabled);
  EXPECT_EQ(drive_state(kQuickStopped), DriveState::kQuickStopActive);
  EXPECT_EQ(drive_state(kReaction), DriveState::kFaultReaction);
  EXPECT_EQ(drive_state(kFaulted), DriveState::kFault);
  EXPECT_FALSE(drive_state(0x0001));
  EXPECT_FALSE(drive_state(0x004F));
}

TEST(Cia402Axis, ClimbsToOperationStepByStep) {
  Cia402Axis axis;
  axis.aim(AxisAim::kOperation, seconds(1));
  EXPECT_EQ(axis.step(kNotReady, seconds(1)), controlword::kDisableVoltage);
  EXPECT_EQ(axis.step(kDisabled, seconds(1)), controlword::kShutdown);
  EXPECT_EQ(axis.step(kReady, seconds(1)), controlword::kSwitchOn);
  EXPECT_EQ(axis.step(kSwitchedOn, seconds(1)), controlword::kEnableOperation);
  EXPECT_FALSE(axis.arrived());
  EXPECT_EQ(axis.step(kEnabled, seconds(1)), controlword::kEnableOperation);
  EXPECT_TRUE(axis.arrived());
}

TEST(Cia402Axis, EveryStateOnTheWayIsBoundedInTime) {
  struct Case {
    AxisAim aim;
    std::uint16_t stuck;
    nanoseconds limit;
  };
  const AxisTimeouts timeouts;
  for (const Case& c : {Case{AxisAim::kOperation, kNotReady, timeouts.transition},
                        {AxisAim::kOperation, kDisabled, timeouts.transition},
                        {AxisAim::kOperation, kReady, timeouts.transition},
                        {AxisAim::kOperation, kSwitchedOn, timeouts.transition},
                        {AxisAim::kOff, kEnabled, timeouts.transition},
                        {AxisAim::kQuickStop, kEnabled, timeouts.quick_stop},
                        {AxisAim::kFaultReset, kFaulted, timeouts.fault_reset}}) {
    Cia402Axis axis;
    axis.aim(c.aim, nanoseconds(0));
    nanoseconds now{0};
    while (!axis.failure() && now < seconds(20)) axis.step(c.stuck, now), now += milliseconds(10);
    EXPECT_EQ(axis.failure().fault, AxisFault::kTimedOut);
    EXPECT_LE(now, c.limit + milliseconds(50));
    EXPECT_GE(now, c.limit);
  }
}

TEST(Cia402Axis, AFailureNamesAxisStateAndWords) {
  Cia402Axis axis;
  axis.aim(AxisAim::kOperation, nanoseconds(0));
  for (int i = 0; i < 60; ++i) axis.step(kSwitchedOn, milliseconds(10 * i));
  EXPECT_EQ(to_text(axis.failure(), "joint_3", 3),
            "joint_3 (node 3): stayed in \"switched on\" for 0.51 s on the way to operation enabled (6041 statusword "
            "0x0233 \"switched on\", 6040 controlword 0x000F)");
}

TEST(Cia402Axis, ADriveThatLeavesOperationIsNotSentBack) {
  Cia402Axis axis;
  axis.aim(AxisAim::kOperation, nanoseconds(0));
  axis.step(kEnabled, nanoseconds(0));
  axis.step(kReady, milliseconds(10));
  EXPECT_EQ(axis.failure().fault, AxisFault::kLeftOperation);
  for (int i = 2; i < 10; ++i) EXPECT_EQ(axis.step(kReady, milliseconds(10 * i)), controlword::kQuickStop);
}

TEST(Cia402Axis, AFaultCarriesTheDrivesErrorCode) {
  Cia402Axis axis;
  axis.aim(AxisAim::kOperation, nanoseconds(0));
  axis.step(kEnabled, nanoseconds(0));
  axis.set_error_code(0x2310);
  axis.step(kReaction, milliseconds(10));
  EXPECT_EQ(axis.failure().fault, AxisFault::kDriveFault);
  EXPECT_NE(to_text(axis.failure(), "joint_1", 1).find("603F error 0x2310: continuous over-current"),
            std::string::npos);
}

TEST(Cia402Axis, AFaultIsResetByRisingEdges) {
  Cia402Axis axis;
  axis.aim(AxisAim::kFaultReset, nanoseconds(0));
  EXPECT_EQ(axis.step(kFaulted, nanoseconds(0)), controlword::kFaultReset);
  EXPECT_EQ(axis.step(kFaulted, milliseconds(10)), 0);
  EXPECT_EQ(axis.step(kFaulted, milliseconds(20)), controlword::kFaultReset);
  axis.step(kDisabled, milliseconds(30));
  EXPECT_TRUE(axis.arrived());
}

TEST(Cia402Axis, AnUnknownStatuswordMayPassOnceButNotStay) {
  Cia402Axis axis;
  axis.aim(AxisAim::kOperation, nanoseconds(0));
  axis.step(kEnabled, nanoseconds(0));
  EXPECT_EQ(axis.step(0x0001, milliseconds(10)), controlword::kEnableOperation);
  axis.step(kEnabled, milliseconds(20));
  EXPECT_FALSE(axis.failure());
  for (int i = 3; i < 6; ++i) axis.step(0x0001, milliseconds(10 * i));
  EXPECT_EQ(axis.failure().fault, AxisFault::kUnknownState);
}

/// One drive in a mode, its PDOs exchanged every 10 ms by hand.
class DrivenAxis {
 public:
  explicit DrivenAxis(DriveMode mode, const sim::SimDriveOptions& options = {.node = SimulatedNode::kNode})
      : node_(options) {
    setup_.name = "axis";
    setup_.node = SimulatedNode::kNode;
    setup_.mode = mode;
    setup_.quick_stop_deceleration = 1'000'000;
    setup_.profile_speed = 50'000;
    setup_.profile_acceleration = 200'000;
    setup_.following_error_window = 5000;
    setup_.homing = {17, 20'000, 2000, 200'000, 500};
  }

  std::string set_up() { return set_up_drive(node_.master(), setup_); }
  void cycle(std::int32_t target) {
    const ReceivedPdo& pdo = node_.master().received(1, SimulatedNode::kNode);
    std::array<std::uint8_t, 6> data{};
    if (pdo.count > 0) {
      put_number(axis_.step(static_cast<std::uint16_t>(get_number(std::span(pdo.data).first(2), false)),
                            node_.clock().monotonic()),
                 2, data.data());
    }
    put_number(target, 4, data.data() + 2);
    node_.master().send_pdo(0x200 + SimulatedNode::kNode, data);
    node_.master().send_sync();
    node_.pass(milliseconds(10));
  }
  /// Cycles until it holds. The time it took, or a negative one.
  template <typename Done>
  double until(std::int32_t target, Done&& done) {
    const nanoseconds begin = node_.clock().monotonic();
    for (int i = 0; i < 6000; ++i) {
      if (done()) return std::chrono::duration<double>(node_.clock().monotonic() - begin).count();
      if (axis_.failure()) return -2;
      cycle(target);
    }
    return -1;
  }
  bool enable() {
    axis_.aim(AxisAim::kOperation, node_.clock().monotonic());
    return until(0, [this] { return axis_.arrived(); }) >= 0;
  }

  Cia402Axis& axis() { return axis_; }
  SimulatedNode& node() { return node_; }
  sim::SimDrive& drive() { return node_.drive(); }
  const DriveSetup& setup() const { return setup_; }

 private:
  SimulatedNode node_;
  Cia402Axis axis_;
  DriveSetup setup_;
};

TEST(ProfilePosition, ArrivesAtTheTrapezoidsTime) {
  DrivenAxis driven(DriveMode::kProfilePosition);
  ASSERT_EQ(driven.set_up(), "");
  ASSERT_TRUE(driven.enable());
  driven.axis().start_move(driven.node().clock().monotonic());
  const double time = driven.until(100'000, [&] { return driven.axis().moved(); });
  EXPECT_NEAR(driven.drive().actual_position(), 100'000, 10);
  EXPECT_NEAR(time, 100'000.0 / 50'000 + 50'000.0 / 200'000, 0.2);  // way over speed, and one ramp
  driven.axis().start_move(driven.node().clock().monotonic());
  EXPECT_GT(driven.until(-30'000, [&] { return driven.axis().moved(); }), 2);
  EXPECT_NEAR(driven.drive().actual_position(), -30'000, 10);
}

TEST(ProfilePosition, ATargetThatIsNotTakenIsAFailure) {
  Cia402Axis axis;
  axis.aim(AxisAim::kOperation, nanoseconds(0));
  axis.step(kEnabled, nanoseconds(0));
  axis.start_move(nanoseconds(0));
  for (int i = 0; i < 30; ++i) axis.step(kEnabled, milliseconds(10 * i));
  EXPECT_EQ(axis.failure().fault, AxisFault::kSetPointIgnored);
}

TEST(Homing, FindsTheSwitchsEdgeAndCountsFromThere) {
  sim::SimDriveOptions options;
  options.node = SimulatedNode::kNode;
  options.motor.position = 40'000;
  options.switches.negative = 12'345;
  DrivenAxis driven(DriveMode::kHoming, options);
  ASSERT_EQ(driven.set_up(), "");
  ASSERT_TRUE(driven.enable());
  driven.axis().start_homing(driven.node().clock().monotonic());
  EXPECT_GT(driven.until(0, [&] { return driven.axis().homed(); }), 1);
  // At the edge 6064 is 607C.
  EXPECT_NEAR(driven.drive().motor().position() - 12'345, driven.drive().actual_position() - 500, 1);
  // Again, from the switch's side: what was attained before does not count.
  driven.axis().start_homing(driven.node().clock().monotonic());
  EXPECT_FALSE(driven.axis().homed());
  EXPECT_GT(driven.until(0, [&] { return driven.axis().homed(); }), 0.02);
}

TEST(Homing, ASwitchThatNeverComesIsBoundedInTime) {
  DrivenAxis driven(DriveMode::kHoming);
  ASSERT_EQ(driven.set_up(), "");
  ASSERT_TRUE(driven.enable());
  const nanoseconds begin = driven.node().clock().monotonic();
  driven.axis().start_homing(begin);
  EXPECT_EQ(driven.until(0, [&] { return driven.axis().homed(); }), -2);
  EXPECT_EQ(driven.axis().failure().fault, AxisFault::kHomingFailed);
  EXPECT_LE(driven.node().clock().monotonic() - begin, seconds(31));
}

TEST(CyclicVelocity, RunsAtTheSpeedThatIsAskedFor) {
  DrivenAxis driven(DriveMode::kCyclicVelocity);
  ASSERT_EQ(driven.set_up(), "");
  ASSERT_TRUE(driven.enable());
  for (int i = 0; i < 100; ++i) driven.cycle(30'000);
  const double before = driven.drive().motor().position();
  for (int i = 0; i < 100; ++i) driven.cycle(30'000);
  EXPECT_NEAR(driven.drive().motor().position() - before, 30'000, 300);  // in a second
}

TEST(QuickStop, BrakesByItsOwnRampAndHolds) {
  DrivenAxis driven(DriveMode::kCyclicVelocity);
  ASSERT_EQ(driven.set_up(), "");
  ASSERT_TRUE(driven.enable());
  for (int i = 0; i < 100; ++i) driven.cycle(50'000);
  const double before = driven.drive().motor().position();
  driven.axis().aim(AxisAim::kQuickStop, driven.node().clock().monotonic());
  for (int i = 0; i < 100; ++i) driven.cycle(50'000);
  EXPECT_TRUE(driven.axis().arrived());
  EXPECT_EQ(driven.drive().state(), DriveState::kQuickStopActive);
  EXPECT_NEAR(driven.drive().motor().speed(), 0, 1);
  // v^2 / 2a = 1250, and 20 ms until the order arrives at the next SYNC.
  EXPECT_LT(driven.drive().motor().position() - before, 1250 + 0.02 * 50'000 + 200);
}

TEST(FollowingError, ABlockedMotorTripsTheDrivesOwnWatch) {
  DrivenAxis driven(DriveMode::kCyclicPosition);
  ASSERT_EQ(driven.set_up(), "");
  ASSERT_TRUE(driven.enable());
  driven.drive().dictionary().write(sim::kBlockObject, 1);
  for (int i = 0; i < 100; ++i) driven.cycle(300 * i);
  EXPECT_EQ(driven.drive().state(), DriveState::kFault);
  EXPECT_EQ(driven.node().master().node(SimulatedNode::kNode).emergency.error_code, 0x8611);
  EXPECT_EQ(driven.axis().failure().fault, AxisFault::kDriveFault);
}

TEST(LostMaster, TheDriveStopsByItself) {
  DrivenAxis driven(DriveMode::kCyclicVelocity);
  ASSERT_EQ(driven.set_up(), "");
  ASSERT_TRUE(driven.enable());
  for (int i = 0; i < 100; ++i) driven.cycle(50'000);
  driven.node().network().advance_to(driven.node().clock().monotonic() + milliseconds(79));
  EXPECT_EQ(driven.drive().state(), DriveState::kOperationEnabled);
  driven.node().network().advance_to(driven.node().clock().monotonic() + milliseconds(22));
  EXPECT_EQ(driven.drive().state(), DriveState::kQuickStopActive);
  driven.node().network().advance_to(driven.node().clock().monotonic() + milliseconds(150));
  EXPECT_NEAR(driven.drive().motor().speed(), 0, 1);
}

}  // namespace
}  // namespace vantage::can
