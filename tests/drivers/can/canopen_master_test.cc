#include "drivers/can/canopen_master.h"

#include <stdexcept>
#include <string>

#include <gtest/gtest.h>

#include "drivers/can/drive_setup.h"
#include "drivers/can/eds.h"
#include "simulated_node.h"

namespace vantage::can {
namespace {

using std::chrono::milliseconds;
constexpr std::uint8_t kNode = SimulatedNode::kNode;

std::span<const std::uint8_t> bytes_of(const std::string& text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

DriveSetup setup_of(SimulatedNode&) {
  DriveSetup setup;
  setup.name = "joint_x";
  setup.node = kNode;
  setup.quick_stop_deceleration = 1'000'000;
  setup.profile_speed = 100'000;
  setup.profile_acceleration = 500'000;
  setup.following_error_window = 5000;
  setup.lowest_position = -100'000;
  setup.highest_position = 100'000;
  setup.homing = {37, 1000, 1000, 10'000, 0};
  return setup;
}

TEST(CanopenMaster, ReadsAndWritesNumbersAndTextsOfAnyLength) {
  SimulatedNode node;
  std::int64_t value = 0;
  EXPECT_TRUE(node.master().read_number(kNode, objects::kDeviceType, &value).ok());
  EXPECT_EQ(value & 0xFFFF, 402);
  EXPECT_TRUE(node.master().write_verified(kNode, objects::kLowestPosition, -12345).ok());
  EXPECT_TRUE(node.master().read_number(kNode, objects::kLowestPosition, &value).ok());
  EXPECT_EQ(value, -12345);
  std::vector<std::uint8_t> data;
  EXPECT_TRUE(node.master().read(kNode, objects::kDeviceName, &data).ok());
  EXPECT_EQ(std::string(data.begin(), data.end()), "Vantage simulated drive");
  // Lengths around a segment's seven bytes and the expedited four.
  for (const std::size_t length : {0, 1, 4, 5, 6, 7, 8, 13, 14, 15, 100, 256}) {
    const std::string text(length, 'x');
    EXPECT_EQ(node.master().write(kNode, sim::kAxisLabel, bytes_of(text)).fault, "") << length;
    EXPECT_TRUE(node.master().read(kNode, sim::kAxisLabel, &data).ok());
    EXPECT_EQ(data.size(), length);
  }
  const SdoOutcome longer = node.master().write(kNode, sim::kAxisLabel, bytes_of(std::string(257, 'x')));
  EXPECT_EQ(longer.fault, "writing 2000: the value is longer than the object (abort 0x06070012)");
}

TEST(CanopenMaster, FaultsNameObjectAndReason) {
  SimulatedNode node;
  std::int64_t value = 0;
  EXPECT_EQ(node.master().read_number(kNode, {0x6099, 9}, &value).fault,
            "reading 6099:9: the object has no such subindex (abort 0x06090011)");
  EXPECT_EQ(node.master().read_number(kNode, {0x5555, 0}, &value).fault,
            "reading 5555: the drive has no such object (abort 0x06020000)");
  EXPECT_EQ(node.master().write(kNode, objects::kStatusword, bytes_of("ab")).fault,
            "writing 6041 (statusword): the object can only be read (abort 0x06010002)");
  EXPECT_EQ(node.master().write_number(kNode, objects::kFollowingErrorWindow, 5'000'000).fault,
            "writing 6065 (following error window): value too high (abort 0x06090031)");
  EXPECT_EQ(node.master().write_number(kNode, objects::kMode, 200).fault,
            "writing 200 to 6060 (mode of operation): the drive takes -128 to 127");
}

TEST(CanopenMaster, AnEdssLimitsAreKeptBeforeAnythingIsSent) {
  SimulatedNode node;
  const Eds eds = load_eds(VANTAGE_SOURCE_DIR "/calib/rigs/simulated_drive.eds", kNode);
  int sent = 0;
  node.network().set_witness([&sent](const CanFrame& frame) { sent += frame.id == sdo_to_drive(kNode) ? 1 : 0; });
  EXPECT_EQ(node.master().write_number(kNode, objects::kFollowingErrorWindow, 5'000'000, eds.objects).fault,
            "writing 5000000 to 6065 (following error window): the drive takes 1 to 4000000");
  EXPECT_EQ(sent, 0);
}

TEST(CanopenMaster, ASilentDriveIsGivenUpAfterTwoTries) {
  SimulatedNode node;
  node.drive().kill();
  int sent = 0;
  node.network().set_witness([&sent](const CanFrame& frame) { sent += frame.id == sdo_to_drive(kNode) ? 1 : 0; });
  const auto begin = node.clock().monotonic();
  std::int64_t value = 0;
  EXPECT_EQ(node.master().read_number(kNode, objects::kDeviceType, &value).fault,
            "reading 1000 (device type): no answer in time (abort 0x05040000)");
  EXPECT_EQ(sent, 2);
  EXPECT_LE(node.clock().monotonic() - begin, milliseconds(450));
}

TEST(CanopenMaster, ItsHeartbeatGoesOutEveryPeriodAndEndsWithItsPolling) {
  SimulatedNode node;
  std::vector<std::chrono::nanoseconds> heartbeats;
  node.network().set_witness([&](const CanFrame& frame) {
    if (frame.id == 0x77F) heartbeats.push_back(frame.time);
  });
  node.pass(milliseconds(1000));
  EXPECT_NEAR(static_cast<double>(heartbeats.size()), 50, 1);
  for (std::size_t i = 1; i < heartbeats.size(); ++i) EXPECT_LE(heartbeats[i] - heartbeats[i - 1], milliseconds(21));
  const std::size_t before = heartbeats.size();
  node.network().advance_to(node.clock().monotonic() + milliseconds(500));
  EXPECT_EQ(heartbeats.size(), before);
  node.pass(milliseconds(0));
  EXPECT_EQ(heartbeats.size(), before + 1);  // what was missed is not made up for
}

TEST(CanopenMaster, HearsHeartbeatBootAndEmergency) {
  SimulatedNode node;
  EXPECT_TRUE(node.master().node(kNode).heard);
  EXPECT_EQ(node.master().node(kNode).boots, 1U);
  EXPECT_TRUE(node.master().write_number(kNode, objects::kProducerHeartbeat, 10).ok());
  node.master().send_nmt(NmtCommand::kStart, kNode);
  node.pass(milliseconds(20));
  EXPECT_EQ(node.master().node(kNode).state, NmtState::kOperational);
  node.master().send_nmt(NmtCommand::kStop, kNode);
  node.pass(milliseconds(20));
  EXPECT_EQ(node.master().node(kNode).state, NmtState::kStopped);
  node.master().send_nmt(NmtCommand::kPreOperational, kNode);
  EXPECT_TRUE(node.master().write_number(kNode, sim::kTripObject, 0x3210, node.drive().dictionary().entries()).ok());
  node.pass(milliseconds(5));
  EXPECT_EQ(node.master().node(kNode).emergencies, 1U);
  EXPECT_EQ(node.master().node(kNode).emergency.error_code, 0x3210);
}

TEST(CanopenMaster, OptionsThatMakeNoSenseAreRefused) {
  ManualClock clock;
  MemoryCanNetwork network(clock);
  const auto bus = network.attach("master");
  EXPECT_THROW(CanopenMaster(*bus, clock, {.node = 0}), std::invalid_argument);
  EXPECT_THROW(CanopenMaster(*bus, clock, {.heartbeat_period = std::chrono::nanoseconds(0)}), std::invalid_argument);
}

TEST(DriveSetup, TellsTheDriveAllAndReadsItBack) {
  SimulatedNode node;
  EXPECT_EQ(set_up_drive(node.master(), setup_of(node)), "");
  const sim::DriveDictionary& dictionary = node.drive().dictionary();
  EXPECT_EQ(dictionary.get(objects::kMasterHeartbeat), 0x7F0064);  // node 127, 100 ms
  EXPECT_EQ(dictionary.get(objects::kConnectionLossReaction), 3);
  EXPECT_EQ(dictionary.get({0x1600, 1}), 0x60400010);
  EXPECT_EQ(dictionary.get({0x1600, 2}), 0x607A0020);
  EXPECT_EQ(dictionary.get({0x1A00, 2}), 0x60640020);
  EXPECT_EQ(dictionary.get({0x1400, 1}), 0x205);
  EXPECT_EQ(dictionary.get({0x1800, 2}), 1);
  EXPECT_EQ(dictionary.get({0x1401, 1}) & 0x80000000, 0x80000000);
  EXPECT_EQ(dictionary.get(objects::kModeDisplay), 8);
  EXPECT_EQ(node.drive().nmt(), NmtState::kOperational);
  EXPECT_EQ(node.drive().state(), DriveState::kSwitchOnDisabled);  // no power
}

TEST(DriveSetup, AVelocityAxisGetsItsVelocityMapped) {
  SimulatedNode node;
  DriveSetup setup = setup_of(node);
  setup.mode = DriveMode::kCyclicVelocity;
  EXPECT_EQ(set_up_drive(node.master(), setup), "");
  EXPECT_EQ(node.drive().dictionary().get({0x1600, 2}), 0x60FF0020);
  EXPECT_EQ(set_up_drive(node.master(), setup_of(node)), "");  // and again, from operational, as another
  EXPECT_EQ(node.drive().dictionary().get({0x1600, 2}), 0x607A0020);
}

TEST(DriveSetup, EveryFaultNamesTheAxisAndTheObject) {
  {
    SimulatedNode node;
    DriveSetup setup = setup_of(node);
    setup.following_error_window = 5'000'000;
    EXPECT_EQ(set_up_drive(node.master(), setup),
              "joint_x (node 5): writing 6065 (following error window): value too high (abort 0x06090031)");
    setup = setup_of(node);
    setup.mode = DriveMode::kCyclicTorque;
    EXPECT_EQ(set_up_drive(node.master(), setup),
              "joint_x (node 5): does not support cyclic synchronous torque (6502)");
    setup = setup_of(node);
    setup.vendor = 42;
    EXPECT_NE(set_up_drive(node.master(), setup).find("its EDS describes vendor 42"), std::string::npos);
    node.drive().dictionary().set(objects::kDeviceType, 401);
    EXPECT_EQ(set_up_drive(node.master(), setup_of(node)),
              "joint_x (node 5): is no drive of CiA 402: its device type (1000) is of profile 401");
  }
  SimulatedNode node;
  node.drive().kill();
  EXPECT_EQ(set_up_drive(node.master(), setup_of(node)),
            "joint_x (node 5): reading 1000 (device type): no answer in time (abort 0x05040000)");
}

TEST(DriveSetup, ADriveThatKeepsAnotherValueIsFoundOut) {
  SimulatedNode node;
  // A drive that rounds its cycle time without a word.
  node.drive().dictionary().on_write([](ObjectAddress, std::int64_t) { return std::optional<SdoAbort>(); },
                                     [&node](ObjectAddress address, std::int64_t) {
                                       if (address == objects::kCyclePeriod) node.drive().dictionary().set(address, 8);
                                     });
  EXPECT_EQ(set_up_drive(node.master(), setup_of(node)),
            "joint_x (node 5): writing 60C2:1 (cycle time, number): the drive keeps 8 (1 bytes) instead of 10");
}

}  // namespace
}  // namespace vantage::can
