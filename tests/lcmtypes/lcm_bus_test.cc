// Runs in a network namespace of its own when it may make one: LCM's multicast stays inside.
#include "lcmtypes/link/lcm_bus.h"

#include <cstdlib>

#include <gtest/gtest.h>
#include <sched.h>
#include <unistd.h>

#include "calib/files/input_error.h"
#include "lcmtypes/link/depth_codec.h"
#include "lcmtypes/link/depth_map_receiver.h"
#include "lcmtypes/link/depth_map_sender.h"
#include "lcmtypes/link/network_link.h"
#include "tests/lcmtypes/sample_depth_map.h"

namespace vantage {
namespace {

using std::chrono::milliseconds;

/// A namespace without any interface up: no route leads anywhere.
bool enter_empty_network() { return ::unshare(::geteuid() == 0 ? CLONE_NEWNET : CLONE_NEWUSER | CLONE_NEWNET) == 0; }

bool add_loopback_route() {
  return std::system("ip link set lo up && ip link set lo multicast on && ip route add 224.0.0.0/4 dev lo") == 0;
}

TEST(LcmBus, AMissingRouteIsOneLineWithTheMend) {
  ASSERT_TRUE(enter_empty_network()) << "these tests need unshare(CLONE_NEWNET)";
  try {
    LcmBus bus;
    FAIL() << "made a bus without a route";
  } catch (const InputError& error) {
    const std::string text = error.what();
    EXPECT_NE(text.find("ip route add 224.0.0.0/4 dev lo"), std::string::npos) << text;
    EXPECT_EQ(text.find('\n'), std::string::npos);
  }
}

TEST(LcmBus, ANonsenseAddressIsNamed) { EXPECT_THROW(LcmBus("udpm://no-address:1"), InputError); }

TEST(LcmBus, OnlyLoopbackWithoutATimeToLiveIsPrivate) {
  ASSERT_TRUE(enter_empty_network());
  ASSERT_TRUE(add_loopback_route());
  EXPECT_TRUE(LcmBus::stays_on_this_machine(LcmBus::kDefaultUrl));
  EXPECT_TRUE(LcmBus::stays_on_this_machine("udpm://239.255.76.67:7667"));  // LCM's own default is a TTL of 0
  EXPECT_FALSE(LcmBus::stays_on_this_machine("udpm://239.255.76.67:7667?ttl=1"));
  EXPECT_FALSE(LcmBus::stays_on_this_machine("udpm://239.255.76.67:7667?recv_buf_size=1000&ttl=10"));
  EXPECT_FALSE(LcmBus::stays_on_this_machine("tcpq://192.0.2.1:7700"));
  EXPECT_TRUE(LcmBus::stays_on_this_machine("memq://"));
  // Another interface's route is more special than loopback's.
  ASSERT_EQ(std::system("ip link add beyond type veth peer name other && ip addr add 192.0.2.1/24 dev beyond && "
                        "ip link set beyond up && ip route add 239.255.0.0/16 dev beyond"),
            0);
  EXPECT_FALSE(LcmBus::stays_on_this_machine(LcmBus::kDefaultUrl));
  EXPECT_THROW(NetworkLink({}), InputError);
  EXPECT_NO_THROW(NetworkLink({.insecure = true}));
}

TEST(LcmBus, CarriesDepthMapsWhole) {
  ASSERT_TRUE(enter_empty_network());
  ASSERT_TRUE(add_loopback_route());
  LcmBus robot_bus, planner_bus;
  const SystemClock clock;
  std::vector<depth_map_t> received;
  DepthMapReceiver receiver(planner_bus, clock, [&](const depth_map_t& map) { received.push_back(map); });
  DepthMapSender sender(robot_bus, clock);
  std::vector<depth_map_t> sent;
  for (unsigned i = 1; i <= 3; ++i) {
    sent.push_back(pack_depth_map(sample_depth_map(640, 480, i)));
    sender.enqueue(sent.back());
  }
  for (int i = 0; i < 60'000 && !sender.idle(); ++i) {
    sender.step();
    while (planner_bus.handle(milliseconds(0))) {
    }
    receiver.step();
    while (robot_bus.handle(milliseconds(0))) {
    }
    ::usleep(200);
  }
  ASSERT_EQ(received.size(), sent.size());
  for (std::size_t i = 0; i < sent.size(); ++i) EXPECT_EQ(encode_message(received[i]), encode_message(sent[i]));
}

TEST(LcmBus, AHandlersExceptionReachesTheCaller) {
  ASSERT_TRUE(enter_empty_network());
  ASSERT_TRUE(add_loopback_route());
  LcmBus bus;
  bus.subscribe("X", [](std::span<const std::uint8_t>) { throw std::runtime_error("from the handler"); });
  bus.publish("X", std::vector<std::uint8_t>(3));
  EXPECT_THROW(
      {
        for (int i = 0; i < 100; ++i) bus.handle(milliseconds(20));
      },
      std::runtime_error);
}

}  // namespace
}  // namespace vantage
