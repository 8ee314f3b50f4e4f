// SocketCAN of a real kernel, on vcan.

#include <thread>

#include <gtest/gtest.h>
#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/socket.h>
#include <unistd.h>

#include "drivers/can/bus_error.h"
#include "drivers/can/canopen_master.h"
#include "drivers/can/socket_can_bus.h"
#include "lcmtypes/link/clock.h"
#include "shell.h"
#include "tests/input_fault.h"

namespace vantage::can {
namespace {

using std::chrono::milliseconds;
using std::chrono::nanoseconds;
using std::chrono::seconds;

nanoseconds now() { return SystemClock().monotonic(); }

TEST(SocketCan, FramesArriveWholeWithTheKernelsTimeOnTheMonotonicClock) {
  const auto sender = open_socket_can("vcan0"), receiver = open_socket_can("vcan0");
  const std::uint32_t ids[] = {0x181};
  receiver->accept_only(ids);
  const nanoseconds before = now();
  ASSERT_EQ(sender->send(make_frame(0x181, {1, 2, 3, 4, 5})), SendResult::kSent);
  const nanoseconds after = now();
  std::this_thread::sleep_for(milliseconds(50));  // it lies in the queue: its stamp must not follow
  CanFrame frame;
  ASSERT_TRUE(receiver->wait_until(now() + seconds(1)));
  ASSERT_EQ(receiver->receive(&frame), ReceiveResult::kFrame);
  EXPECT_TRUE(same_on_wire(frame, make_frame(0x181, {1, 2, 3, 4, 5})));
  // The two clocks are read one after the other, which a virtual machine may take its time for.
  EXPECT_GE(frame.time, before - milliseconds(2));
  EXPECT_LE(frame.time, after + milliseconds(20));
  EXPECT_EQ(receiver->receive(&frame), ReceiveResult::kNothing);
  EXPECT_EQ(sender->receive(&frame), ReceiveResult::kNothing);  // not its own
  EXPECT_EQ(receiver->counters().odd_stamps, 0U);
}

TEST(SocketCan, ExactlyTheWantedIdentifiersPass) {
  const auto sender = open_socket_can("vcan0"), receiver = open_socket_can("vcan0");
  const std::uint32_t ids[] = {0x182, 0x702};
  receiver->accept_only(ids);
  for (std::uint32_t id = 0; id < 0x800; ++id) ASSERT_EQ(sender->send(make_frame(id, {})), SendResult::kSent);
  CanFrame extended = make_frame(0x182, {});
  extended.extended = true;
  CanFrame remote = make_frame(0x182, {});
  remote.remote = true;
  sender->send(extended);
  sender->send(remote);
  CanFrame frame;
  std::vector<std::uint32_t> got;
  while (receiver->receive(&frame) == ReceiveResult::kFrame) got.push_back(frame.id);
  EXPECT_EQ(got, (std::vector<std::uint32_t>{0x182, 0x702}));
}

TEST(SocketCan, ErrorFramesOfTheControllerReachTheMaster) {
  const auto controller = open_socket_can("vcan0"), bus = open_socket_can("vcan0");
  const SystemClock clock;
  CanopenMaster master(*bus, clock);
  CanFrame error;
  error.error = true;
  error.size = 8;
  for (const std::uint32_t kind : {CAN_ERR_BUSOFF, CAN_ERR_RESTARTED, CAN_ERR_ACK, CAN_ERR_TX_TIMEOUT}) {
    error.id = kind;
    ASSERT_EQ(controller->send(error), SendResult::kSent);
  }
  master.poll_until(now() + milliseconds(20));
  EXPECT_EQ(master.bus_faults().bus_off, 1U);
  EXPECT_EQ(master.bus_faults().restarted, 1U);
  EXPECT_EQ(master.bus_faults().no_acknowledge, 1U);
  EXPECT_EQ(master.bus_faults().transmit_timeout, 1U);
}

TEST(SocketCan, AnOverflowingReceiveQueueIsCounted) {
  const auto sender = open_socket_can("vcan0"), receiver = open_socket_can("vcan0");
  const std::uint32_t ids[] = {0x181};
  receiver->accept_only(ids);
  constexpr std::uint64_t kSent = 5000;
  for (std::uint64_t i = 0; i < kSent; ++i) sender->send(make_frame(0x181, {0}));
  CanFrame frame;
  while (receiver->receive(&frame) == ReceiveResult::kFrame) {
  }
  sender->send(make_frame(0x181, {1}));  // the next frame brings the count
  ASSERT_TRUE(receiver->wait_until(now() + seconds(1)));
  while (receiver->receive(&frame) == ReceiveResult::kFrame) {
  }
  EXPECT_GT(receiver->counters().overflowed, 0U);
  EXPECT_EQ(receiver->counters().received + receiver->counters().overflowed, kSent + 1);
}

TEST(SocketCan, AFullTransmitQueueIsToldAndNotWaitedFor) {
  shell("tc qdisc add dev vcan1 root netem delay 10s limit 5");
  const auto bus = open_socket_can("vcan1");
  SendResult worst = SendResult::kSent;
  for (int i = 0; i < 100 && worst == SendResult::kSent; ++i) worst = bus->send(make_frame(0x201, {1, 2, 3}));
  EXPECT_EQ(worst, SendResult::kQueueFull);
  EXPECT_EQ(bus->counters().refused_sends, 1U);
  shell("tc qdisc del dev vcan1 root");
  EXPECT_EQ(bus->send(make_frame(0x201, {})), SendResult::kSent);
}

TEST(SocketCan, TheSocketOutlivesAnInterfaceThatGoesDownAndUp) {
  const auto bus = open_socket_can("vcan1"), other = open_socket_can("vcan1");
  const std::uint32_t ids[] = {0x181};
  bus->accept_only(ids);
  shell("ip link set vcan1 down");
  CanFrame frame;
  EXPECT_EQ(bus->receive(&frame), ReceiveResult::kDown);  // told once
  EXPECT_EQ(bus->send(make_frame(0x201, {})), SendResult::kDown);
  shell("ip link set vcan1 up");
  EXPECT_EQ(bus->send(make_frame(0x201, {})), SendResult::kSent);
  other->receive(&frame);  // takes the news of its own
  ASSERT_EQ(other->send(make_frame(0x181, {7})), SendResult::kSent);
  ASSERT_TRUE(bus->wait_until(now() + seconds(1)));
  EXPECT_EQ(bus->receive(&frame), ReceiveResult::kFrame);
}

TEST(SocketCan, AnInterfaceThatIsDeletedIsGone) {
  shell("ip link add dev vcan7 type vcan && ip link set vcan7 up");
  const auto bus = open_socket_can("vcan7");
  EXPECT_EQ(bus->send(make_frame(0x201, {})), SendResult::kSent);
  shell("ip link del vcan7");
  EXPECT_EQ(bus->send(make_frame(0x201, {})), SendResult::kGone);
}

TEST(SocketCan, WhatIsNoCanInterfaceIsNamed) {
  EXPECT_NE(input_fault([] { open_socket_can("can9"); }).find("can9: no such network interface; bring it up with"),
            std::string::npos);
  EXPECT_NE(input_fault([] { open_socket_can("lo"); }).find("lo: is no CAN interface"), std::string::npos);
  EXPECT_NE(input_fault([] { open_socket_can(std::string(40, 'c')); }).find("1 to 15 characters"), std::string::npos);
}

TEST(SocketCan, ARestartIsAskedOfTheKernelWhichKnowsThatVcanHasNoController) {
  const auto bus = open_socket_can("vcan0");
  std::string why;
  EXPECT_FALSE(bus->restart(&why));
  EXPECT_NE(why.find("vcan0: the controller can't be restarted: Operation not supported"), std::string::npos) << why;
}

}  // namespace
}  // namespace vantage::can
