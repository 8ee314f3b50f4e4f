#include "drivers/can/unix_can_bus.h"

#include <filesystem>
#include <string>
#include <thread>

#include <gtest/gtest.h>
#include <unistd.h>

#include "drivers/can/open_can_bus.h"
#include "drivers/sim/unix_socket.h"
#include "lcmtypes/link/clock.h"
#include "tests/input_fault.h"

namespace vantage::can {
namespace {

using std::chrono::milliseconds;

class UnixBus : public testing::Test {
 protected:
  void SetUp() override {
    char folder[] = "/tmp/can-XXXXXX";
    ASSERT_NE(::mkdtemp(folder), nullptr);
    folder_ = folder;
    path_ = folder_ + "/bus";
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  /// The next frame that comes within a second; one with an impossible identifier when none does.
  static CanFrame next(CanBus& bus, CanBus& server) {
    CanFrame frame;
    for (int i = 0; i < 200; ++i) {
      CanFrame passing;
      if (&bus != &server) server.receive(&passing);  // the server passes on while it is used
      if (bus.receive(&frame) == ReceiveResult::kFrame) return frame;
      bus.wait_until(SystemClock().monotonic() + milliseconds(5));
    }
    frame.id = 0xFFFFFFFF;
    return frame;
  }

  std::string folder_, path_;
};

TEST_F(UnixBus, EveryoneHearsAllOthersButNotHimself) {
  const auto server = serve_can_bus("sim:" + path_);
  const auto a = open_can_bus("sim:" + path_), b = open_can_bus("sim:" + path_);
  CanFrame nothing;
  server->receive(&nothing);  // lets both in
  ASSERT_EQ(a->send(make_frame(0x123, {1})), SendResult::kSent);
  EXPECT_EQ(next(*server, *server).id, 0x123U);
  EXPECT_EQ(next(*b, *server).id, 0x123U);
  EXPECT_EQ(a->receive(&nothing), ReceiveResult::kNothing);
  ASSERT_EQ(server->send(make_frame(0x321, {2})), SendResult::kSent);
  EXPECT_TRUE(same_on_wire(next(*a, *server), make_frame(0x321, {2})));
  EXPECT_TRUE(same_on_wire(next(*b, *server), make_frame(0x321, {2})));
}

TEST_F(UnixBus, FiltersAreExact) {
  const auto server = serve_unix_can(path_);
  const auto member = join_unix_can(path_);
  CanFrame frame;
  server->receive(&frame);
  const std::uint32_t ids[] = {0x181};
  member->accept_only(ids);
  for (std::uint32_t id = 0x180; id < 0x184; ++id) server->send(make_frame(id, {}));
  EXPECT_EQ(next(*member, *server).id, 0x181U);
  EXPECT_EQ(member->receive(&frame), ReceiveResult::kNothing);
}

TEST_F(UnixBus, WhatIsNoFrameIsCountedAndNotPassedOn) {
  const auto server = serve_unix_can(path_);
  const auto member = join_unix_can(path_);
  const FileDescriptor stranger = sim::connect_to(path_);
  CanFrame frame;
  server->receive(&frame);
  const std::string garbage = "GET / HTTP/1.1";
  ASSERT_TRUE(sim::send_datagram(stranger.get(), std::as_bytes(std::span(garbage))));
  for (int i = 0; i < 20; ++i) server->receive(&frame);
  EXPECT_EQ(server->counters().malformed, 1U);
  EXPECT_EQ(member->receive(&frame), ReceiveResult::kNothing);
}

TEST_F(UnixBus, TheEndOfTheServerIsSeen) {
  auto server = serve_unix_can(path_);
  const auto member = join_unix_can(path_);
  CanFrame frame;
  server->receive(&frame);
  server.reset();
  EXPECT_EQ(member->receive(&frame), ReceiveResult::kGone);
  EXPECT_EQ(member->send(make_frame(0x100, {})), SendResult::kGone);
  EXPECT_FALSE(std::filesystem::exists(path_));
  std::string why;
  EXPECT_FALSE(member->restart(&why));
}

TEST_F(UnixBus, AMemberThatDoesNotReadLosesFramesAndHoldsNobodyUp) {
  const auto server = serve_unix_can(path_);
  const auto asleep = join_unix_can(path_);
  CanFrame frame;
  server->receive(&frame);
  for (int i = 0; i < 20'000; ++i) ASSERT_EQ(server->send(make_frame(0x100, {})), SendResult::kSent);
  EXPECT_GT(server->counters().overflowed, 0U);
}

TEST_F(UnixBus, NobodyThereIsNamedWithTheMend) {
  const std::string fault = input_fault([&] { open_can_bus("sim:" + path_); });
  EXPECT_NE(fault.find("nobody serves a simulated CAN bus there"), std::string::npos) << fault;
  EXPECT_NE(fault.find("vantage-sim --can sim:" + path_), std::string::npos) << fault;
}

}  // namespace
}  // namespace vantage::can
