// Runs in a network namespace of its own, as lcm_bus_test.cc does.
#include "lcmtypes/link/udp_group_receiver.h"

#include <cstdlib>
#include <random>

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <lcm/lcm.h>
#include <sched.h>
#include <sys/socket.h>
#include <unistd.h>

namespace vantage {
namespace {

using Bytes = std::vector<std::uint8_t>;
using std::chrono::milliseconds;

Bytes datagram(const std::string& magic, const std::string& rest) {
  const std::string text = magic + std::string(4, '\1') + rest;
  return {text.begin(), text.end()};
}

TEST(LcmDatagramTest, IsChannelAndMessage) {
  const Bytes bytes = datagram("LC02", std::string("CHANNEL\0abc", 11));
  const LcmDatagram parsed = parse_lcm_datagram(bytes);
  EXPECT_EQ(parsed.channel, "CHANNEL");
  EXPECT_EQ(Bytes(parsed.bytes.begin(), parsed.bytes.end()), (Bytes{'a', 'b', 'c'}));
  EXPECT_FALSE(parsed.fragment);
  EXPECT_TRUE(parse_lcm_datagram(datagram("LC02", std::string("CHANNEL\0", 8))).bytes.empty());
}

TEST(LcmDatagramTest, WhatIsMalformedGivesNothing) {
  for (const Bytes& bytes :
       {Bytes{}, Bytes{'L', 'C', '0', '2'}, datagram("LC02", ""), datagram("LC02", "CHANNEL"),
        datagram("LC02", std::string("\0abc", 4)), datagram("LC01", std::string("CHANNEL\0", 8)),
        datagram("LC02", std::string(64, 'x') + std::string(1, '\0')), datagram("LC02", std::string(60'000, 'x'))}) {
    const LcmDatagram parsed = parse_lcm_datagram(bytes);
    EXPECT_TRUE(parsed.channel.empty() && parsed.bytes.empty() && !parsed.fragment) << bytes.size();
  }
  EXPECT_EQ(parse_lcm_datagram(datagram("LC02", std::string(63, 'x') + std::string(1, '\0'))).channel.size(), 63u);
  EXPECT_TRUE(parse_lcm_datagram(datagram("LC03", std::string("CHANNEL\0", 8))).fragment);
}

class UdpGroupReceiverTest : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_EQ(::unshare(::geteuid() == 0 ? CLONE_NEWNET : CLONE_NEWUSER | CLONE_NEWNET), 0);
    ASSERT_EQ(std::system("ip link set lo up && ip link set lo multicast on && ip route add 224.0.0.0/4 dev lo"), 0);
    ::inet_pton(AF_INET, "239.255.76.67", &group_);
  }
  void send(const Bytes& bytes, in_addr to) {
    const int out = ::socket(AF_INET, SOCK_DGRAM, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(7667);
    address.sin_addr = to;
    EXPECT_EQ(::sendto(out, bytes.data(), bytes.size(), 0, reinterpret_cast<sockaddr*>(&address), sizeof address),
              static_cast<ssize_t>(bytes.size()));
    ::close(out);
  }
  in_addr group_{};
};

TEST_F(UdpGroupReceiverTest, HearsWhatLiblcmSays) {
  UdpGroupReceiver receiver(group_, 7667, 1 << 20);
  std::vector<std::size_t> sizes;
  receiver.subscribe("X", [&](std::span<const std::uint8_t> bytes) { sizes.push_back(bytes.size()); });
  lcm_t* lcm = ::lcm_create("udpm://239.255.76.67:7667?ttl=0");
  const Bytes large(60'000);
  for (const unsigned size : {0u, 1u, 1200u, 60'000u}) ::lcm_publish(lcm, "X", large.data(), size);
  ::lcm_publish(lcm, "NOBODY_HEARS", large.data(), 5);
  for (int i = 0; i < 100 && sizes.size() < 4; ++i) receiver.handle(milliseconds(20));
  EXPECT_EQ(sizes, (std::vector<std::size_t>{0, 1, 1200, 60'000}));
  const Bytes huge(200'000);
  ::lcm_publish(lcm, "X", huge.data(), 200'000);
  for (int i = 0; i < 100 && receiver.counters().fragments < 4; ++i) receiver.handle(milliseconds(20));
  EXPECT_EQ(receiver.counters().fragments, 4u);
  EXPECT_EQ(receiver.counters().accepted, 4u);
  ::lcm_destroy(lcm);
}

TEST_F(UdpGroupReceiverTest, HearsTheGroupAlone) {
  UdpGroupReceiver receiver(group_, 7667, 1 << 20);
  int count = 0;
  receiver.subscribe("X", [&](std::span<const std::uint8_t>) { ++count; });
  send(datagram("LC02", std::string("X\0abc", 5)), {htonl(INADDR_LOOPBACK)});
  EXPECT_FALSE(receiver.handle(milliseconds(50)));
  send(datagram("LC02", std::string("X\0abc", 5)), group_);
  EXPECT_TRUE(receiver.handle(milliseconds(2000)));
  EXPECT_EQ(count, 1);
}

TEST_F(UdpGroupReceiverTest, WhenNobodyHandlesTheQueueStaysBoundedAndSaysSo) {
  UdpGroupReceiver receiver(group_, 7667, 8 << 20);
  std::uint64_t count = 0;
  receiver.subscribe("X", [&](std::span<const std::uint8_t>) { ++count; });
  const Bytes bytes = datagram("LC02", std::string("X\0", 2) + std::string(50'000, 'x'));
  for (int i = 0; i < 500; ++i) {
    send(bytes, group_);
    ::usleep(100);
  }
  ::usleep(100'000);
  EXPECT_LE(receiver.counters().accepted, (16u << 20) / 50'000);
  while (receiver.handle(milliseconds(0))) {
  }
  const UdpGroupReceiver::Counters counters = receiver.counters();
  EXPECT_EQ(count, counters.accepted);
  EXPECT_EQ(counters.accepted + counters.queue_full + counters.socket_full, 500u);
  EXPECT_GT(counters.queue_full, 0u);
}

TEST_F(UdpGroupReceiverTest, RandomDatagramsDoNoHarm) {
  const unsigned seed = 9;
  RecordProperty("seed", static_cast<int>(seed));
  std::mt19937 random(seed);
  UdpGroupReceiver receiver(group_, 7667, 1 << 20);
  int count = 0;
  receiver.subscribe("X", [&](std::span<const std::uint8_t>) { ++count; });
  for (int i = 0; i < 3000; ++i) {
    Bytes bytes = datagram(random() % 2 == 0 ? "LC02" : "LC03", std::string("X\0abcdefgh", 10));
    for (int k = 0; k < 3; ++k) bytes[random() % bytes.size()] = static_cast<std::uint8_t>(random());
    bytes.resize(random() % 64);
    send(bytes, group_);
    receiver.handle(milliseconds(0));
  }
  send(datagram("LC02", std::string("X\0last", 6)), group_);
  const int before = count;
  for (int i = 0; i < 100 && count == before; ++i) receiver.handle(milliseconds(20));
  EXPECT_GT(count, 0);
}

}  // namespace
}  // namespace vantage
