#include "drivers/can/can_frame.h"

#include <cstring>
#include <random>

#include <gtest/gtest.h>
#include <linux/can.h>

namespace vantage::can {
namespace {

std::span<const std::byte> bytes_of(const can_frame& frame) { return std::as_bytes(std::span(&frame, 1)); }

TEST(CanFrame, IsWrittenAsTheKernelLaysItOut) {
  CanFrame frame = make_frame(0x181, {1, 2, 3});
  can_frame kernel{};
  kernel.can_id = 0x181;
  kernel.len = 3;
  kernel.data[0] = 1, kernel.data[1] = 2, kernel.data[2] = 3;
  WireFrame wire = write_wire(frame);
  EXPECT_EQ(std::memcmp(wire.data(), &kernel, sizeof kernel), 0);
  frame.extended = frame.remote = true;
  kernel.can_id |= CAN_EFF_FLAG | CAN_RTR_FLAG;
  wire = write_wire(frame);
  EXPECT_EQ(std::memcmp(wire.data(), &kernel, sizeof kernel), 0);
}

TEST(CanFrame, ComesBackFromTheWireAsItWas) {
  std::mt19937 random(2);
  RecordProperty("seed", 2);
  for (int i = 0; i < 2000; ++i) {
    CanFrame frame;
    frame.extended = random() % 4 == 0;
    frame.remote = random() % 8 == 0;
    frame.id = static_cast<std::uint32_t>(random()) & (frame.extended ? CAN_EFF_MASK : CAN_SFF_MASK);
    frame.size = static_cast<std::uint8_t>(random() % 9);
    for (std::uint8_t& byte : frame.data) byte = static_cast<std::uint8_t>(random());
    CanFrame back;
    ASSERT_TRUE(read_wire(write_wire(frame), &back));
    EXPECT_TRUE(same_on_wire(frame, back));
  }
}

TEST(CanFrame, WhatIsNoFrameIsRefused) {
  CanFrame frame = make_frame(0x7FF, {9});
  can_frame kernel{};
  kernel.len = 9;
  EXPECT_FALSE(read_wire(bytes_of(kernel), &frame));
  kernel.len = 8;
  kernel.can_id = 0x800;  // twelve bits without the extended flag
  EXPECT_FALSE(read_wire(bytes_of(kernel), &frame));
  kernel.can_id = 0x7FF;
  EXPECT_FALSE(read_wire(bytes_of(kernel).first(15), &frame));
  EXPECT_TRUE(same_on_wire(frame, make_frame(0x7FF, {9})));  // untouched
  EXPECT_TRUE(read_wire(bytes_of(kernel), &frame));
}

}  // namespace
}  // namespace vantage::can
