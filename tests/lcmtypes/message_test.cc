#include "lcmtypes/link/message.h"

#include <random>

#include <gtest/gtest.h>

#include "lcmtypes/link/depth_codec.h"
#include "tests/lcmtypes/sample_depth_map.h"

namespace vantage {
namespace {

depth_map_receipt_t sample_receipt() {
  depth_map_receipt_t receipt{};
  receipt.ranges = 3;
  receipt.first = {1, 5, 9};
  receipt.last = {2, 6, 9};
  return receipt;
}

heartbeat_t sample_heartbeat() {
  heartbeat_t heartbeat{};
  heartbeat.version = "0.1.0";
  heartbeat.message = "all is well";
  return heartbeat;
}

depth_map_chunk_t sample_chunk() {
  depth_map_chunk_t chunk{};
  chunk.size = 5;
  chunk.data = {1, 2, 3, 4, 5};
  return chunk;
}

session_config_t sample_config() {
  session_config_t config{};
  config.yaml = "a: 1\n";
  return config;
}

command_t sample_command() {
  command_t command{};
  command.size = 3;
  command.payload = {1, 2, 3};
  return command;
}

status_t sample_status() {
  status_t status{};
  status.counters = 2;
  status.name = {"maps.sent", ""};
  status.value = {7, -1};
  return status;
}

preview_t sample_preview() {
  preview_t preview{};
  preview.size = 2;
  preview.jpeg = {0xff, 0xd8};
  return preview;
}

trajectory_t sample_trajectory() {
  trajectory_t trajectory{};
  trajectory.numbers = 7;
  trajectory.waypoint = {1, 2, 3, 0, 0, 0, 1};
  return trajectory;
}

template <typename Message>
void expect_layout_equals_generated_code(const Message& message) {
  SCOPED_TRACE(Message::getTypeName());
  std::vector<std::uint8_t> bytes = encode_message(message);
  EXPECT_TRUE(layout_fits(kWireLayout<Message>, bytes));
  DecodeCounters counters;
  Message again;
  ASSERT_TRUE(decode_message(bytes, &again, &counters));
  EXPECT_EQ(encode_message(again), bytes);
  // Any other length is refused before the generated decoder runs.
  for (std::size_t cut = 0; cut < bytes.size(); ++cut) {
    EXPECT_FALSE(decode_message(std::span(bytes).first(cut), &again, &counters)) << cut;
  }
  bytes.push_back(0);
  EXPECT_FALSE(decode_message(bytes, &again, &counters));
  EXPECT_EQ(counters.accepted, 1u);
  EXPECT_EQ(counters.malformed, 0u);
}

TEST(Message, LayoutsEqualTheGeneratedCode) {
  expect_layout_equals_generated_code(pack_depth_map(sample_depth_map(16, 12)));
  expect_layout_equals_generated_code(depth_map_manifest_t{});
  expect_layout_equals_generated_code(sample_chunk());
  expect_layout_equals_generated_code(sample_receipt());
  expect_layout_equals_generated_code(key_pose_t{});
  expect_layout_equals_generated_code(motion_goal_t{});
  expect_layout_equals_generated_code(robot_state_t{});
  expect_layout_equals_generated_code(sample_heartbeat());
  expect_layout_equals_generated_code(sample_config());
  expect_layout_equals_generated_code(sample_command());
  expect_layout_equals_generated_code(sample_status());
  expect_layout_equals_generated_code(sample_preview());
  expect_layout_equals_generated_code(sample_trajectory());
}

TEST(Message, AnotherTypeIsRefused) {
  DecodeCounters counters;
  motion_goal_t goal;
  EXPECT_FALSE(decode_message(encode_message(robot_state_t{}), &goal, &counters));
  EXPECT_FALSE(decode_message(std::span<const std::uint8_t>{}, &goal, &counters));
  EXPECT_EQ(counters.wrong_type, 2u);
}

TEST(Message, AClaimOf256MiBAllocatesNothing) {
  std::vector<std::uint8_t> bytes = encode_message(sample_chunk());
  const std::size_t length_at = bytes.size() - 5 - 4;
  for (const std::uint32_t claim : {256u << 20, 0x7fffffffu, 0x80000000u, 0xffffffffu}) {
    for (std::size_t i = 0; i < 4; ++i) bytes[length_at + i] = static_cast<std::uint8_t>(claim >> (24 - 8 * i));
    DecodeCounters counters;
    depth_map_chunk_t chunk{};
    EXPECT_FALSE(decode_message(bytes, &chunk, &counters));
    EXPECT_EQ(chunk.data.capacity(), 0u);
    EXPECT_EQ(counters.wrong_size, 1u);
  }
}

TEST(Message, MutatedBytesNeverPassUnnoticedOrCrash) {
  const unsigned seed = 11;
  RecordProperty("seed", static_cast<int>(seed));
  std::mt19937 random(seed);
  const std::vector<std::uint8_t> good = encode_message(sample_receipt());
  DecodeCounters counters;
  for (int i = 0; i < 20000; ++i) {
    std::vector<std::uint8_t> bytes = good;
    bytes.resize(random() % (2 * good.size()));
    for (int k = 0; k < 4 && !bytes.empty(); ++k) bytes[random() % bytes.size()] = static_cast<std::uint8_t>(random());
    depth_map_receipt_t receipt;
    if (decode_message(bytes, &receipt, &counters)) {
      EXPECT_EQ(encode_message(receipt).size(), bytes.size());
    }
  }
  EXPECT_EQ(counters.accepted + counters.refused(), 20000u);
}

}  // namespace
}  // namespace vantage
