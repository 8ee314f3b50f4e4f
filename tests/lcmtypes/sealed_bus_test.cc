#include "lcmtypes/link/sealed_bus.h"

#include <gtest/gtest.h>
#include <vantage/robot_state_t.hpp>

#include "lcmtypes/link/memory_bus.h"

namespace vantage {
namespace {

using std::chrono::milliseconds;

class SealedBusTest : public testing::Test {
 protected:
  static LinkKey key(std::uint8_t fill) {
    LinkKey key;
    key.fill(fill);
    return key;
  }
  void drain() {
    while (wire_.handle(milliseconds(0))) {
    }
  }
  /// What goes over the wire when `key` says `bytes`.
  std::vector<std::uint8_t> letter(const LinkKey& key, const char* channel, std::vector<std::uint8_t> bytes) {
    MemoryBus wire;
    SealedBus bus(wire, {key});
    std::vector<std::uint8_t> seen;
    wire.subscribe(channel, [&seen](std::span<const std::uint8_t> b) { seen.assign(b.begin(), b.end()); });
    bus.publish(channel, bytes);
    while (wire.handle(milliseconds(0))) {
    }
    return seen;
  }

  MemoryBus wire_;
};

TEST_F(SealedBusTest, WhatTheSameKeySaysArrivesAsItWas) {
  SealedBus robot(wire_, {key(1)}), planner(wire_, {key(1)});
  std::vector<std::uint8_t> heard;
  planner.subscribe(channel::kRobotState, [&](std::span<const std::uint8_t> b) { heard.assign(b.begin(), b.end()); });
  const std::vector<std::uint8_t> said = encode_message(robot_state_t{});
  robot.publish(channel::kRobotState, said);
  drain();
  EXPECT_EQ(heard, said);
  EXPECT_EQ(planner.refused(), 0u);
}

TEST_F(SealedBusTest, AnyOfSeveralKeysOpens) {
  SealedBus robot(wire_, {key(1), key(2)});
  wire_.publish(channel::kCommand, letter(key(2), channel::kCommand, {1, 2, 3}));
  wire_.publish(channel::kCommand, letter(key(3), channel::kCommand, {1, 2, 3}));
  int count = 0;
  robot.subscribe(channel::kCommand, [&count](std::span<const std::uint8_t>) { ++count; });
  drain();
  EXPECT_EQ(count, 1);
  EXPECT_EQ(robot.refused(), 1u);
}

TEST_F(SealedBusTest, EveryChangedBitIsRefused) {
  const std::vector<std::uint8_t> good = letter(key(1), channel::kCommand, {0, 1, 2, 3, 4, 5, 6, 7});
  ASSERT_EQ(good.size(), 8 + SealedBus::kSealBytes);
  SealedBus robot(wire_, {key(1)});
  int count = 0;
  robot.subscribe(channel::kCommand, [&count](std::span<const std::uint8_t>) { ++count; });
  for (std::size_t bit = 0; bit < 8 * good.size(); ++bit) {
    std::vector<std::uint8_t> changed = good;
    changed[bit / 8] = static_cast<std::uint8_t>(changed[bit / 8] ^ 1u << bit % 8);
    wire_.publish(channel::kCommand, changed);
  }
  for (std::size_t size = 0; size < good.size(); ++size) {
    wire_.publish(channel::kCommand, std::span(good).first(size));
  }
  drain();
  EXPECT_EQ(count, 0);
  EXPECT_EQ(robot.refused(), 8 * good.size() + good.size());
  wire_.publish(channel::kCommand, good);
  drain();
  EXPECT_EQ(count, 1);
}

TEST_F(SealedBusTest, ASealHoldsOnItsChannelOnly) {
  SealedBus robot(wire_, {key(1)});
  int count = 0;
  robot.subscribe(channel::kHeartbeat, [&count](std::span<const std::uint8_t>) { ++count; });
  wire_.publish(channel::kHeartbeat, letter(key(1), channel::kRobotState, {1, 2, 3}));
  drain();
  EXPECT_EQ(count, 0);
}

// HMAC-SHA512-256 by another implementation:
//   python3 -c "import
//   hmac,hashlib;print(hmac.new(bytes([1])*32,b'vantage-link-2\0VANTAGE_COMMAND_1\0abc',hashlib.sha512).hexdigest()[:64])"
TEST_F(SealedBusTest, TheSealIsWhatTheHeaderSays) {
  const std::vector<std::uint8_t> seen = letter(key(1), channel::kCommand, {'a', 'b', 'c'});
  std::string hex;
  for (std::size_t i = 3; i < seen.size(); ++i) {
    constexpr const char* kDigits = "0123456789abcdef";
    hex += kDigits[seen[i] >> 4];
    hex += kDigits[seen[i] & 15];
  }
  EXPECT_EQ(hex, "6d72598910275f12e82542347ec9fec0e9f240cfab0d545db93b4c19bc8e279b");
}

TEST_F(SealedBusTest, ChunksAndPreviewsTravelUnsealed) {
  EXPECT_FALSE(SealedBus::sealed(channel::kDepthChunk));
  EXPECT_FALSE(SealedBus::sealed(channel::kPreview));
  EXPECT_EQ(letter(key(1), channel::kDepthChunk, {1, 2}).size(), 2u);
  for (const char* channel : {channel::kDepthManifest, channel::kDepthReceipt, channel::kCommand, channel::kRobotState,
                              channel::kHeartbeat, channel::kStatus, channel::kDepthMap}) {
    EXPECT_TRUE(SealedBus::sealed(channel)) << channel;
  }
}

}  // namespace
}  // namespace vantage
