#include "drivers/can/bus_error.h"

#include <gtest/gtest.h>
#include <linux/can/error.h>

#include "drivers/can/emergency.h"

namespace vantage::can {
namespace {

CanFrame error_frame(std::uint32_t classes) {
  CanFrame frame;
  frame.error = true;
  frame.size = 8;
  frame.id = classes;
  return frame;
}

TEST(BusError, TellsBusOffWithTheControllersCounters) {
  CanFrame frame = error_frame(CAN_ERR_BUSOFF | CAN_ERR_CRTL);
  frame.data[1] = CAN_ERR_CRTL_TX_PASSIVE;
  frame.data[6] = 248;
  BusError error;
  ASSERT_TRUE(read_bus_error(frame, &error));
  EXPECT_TRUE(error.bus_off);
  EXPECT_TRUE(error.passive);
  EXPECT_TRUE(error.breaks_bus());
  EXPECT_EQ(to_text(error),
            "bus-off: the controller has cut itself off; error passive (transmit errors 248, receive errors 0)");
}

TEST(BusError, AWarningDoesNotBreakTheBus) {
  CanFrame frame = error_frame(CAN_ERR_CRTL);
  frame.data[1] = CAN_ERR_CRTL_RX_WARNING;
  BusError error;
  ASSERT_TRUE(read_bus_error(frame, &error));
  EXPECT_TRUE(error.warning);
  EXPECT_FALSE(error.breaks_bus());
  EXPECT_FALSE(read_bus_error(make_frame(0x181, {}), &error));
}

TEST(Emergency, IsReadAndToldInWords) {
  Emergency emergency;
  ASSERT_TRUE(read_emergency(make_frame(0x081, {0x11, 0x86, 0x21, 0, 0, 0, 0, 0}), &emergency));
  EXPECT_EQ(emergency.error_code, 0x8611);
  EXPECT_EQ(emergency.error_register, 0x21);
  EXPECT_FALSE(read_emergency(make_frame(0x081, {0x11, 0x86}), &emergency));
  EXPECT_EQ(error_code_text(0x8611), "error 0x8611: following error too large");
  EXPECT_EQ(error_code_text(0x4399), "error 0x4399: a fault of the temperature");
  EXPECT_EQ(error_code_text(0xFF01), "error 0xFF01: an error of the maker's own");
}

}  // namespace
}  // namespace vantage::can
