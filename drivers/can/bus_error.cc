#include "drivers/can/bus_error.h"

#include <linux/can/error.h>

namespace vantage::can {

bool read_bus_error(const CanFrame& frame, BusError* error) {
  if (!frame.error) return false;
  BusError read;
  const auto has = [&frame](std::uint32_t bit) { return (frame.id & bit) != 0; };
  read.transmit_timeout = has(CAN_ERR_TX_TIMEOUT);
  read.lost_arbitration = has(CAN_ERR_LOSTARB);
  read.no_acknowledge = has(CAN_ERR_ACK);
  read.protocol_violation = has(CAN_ERR_PROT) || has(CAN_ERR_BUSERROR);
  read.bus_off = has(CAN_ERR_BUSOFF);
  read.restarted = has(CAN_ERR_RESTARTED);
  if (has(CAN_ERR_CRTL)) {
    const std::uint8_t controller = frame.data[1];
    read.receive_overflow = (controller & CAN_ERR_CRTL_RX_OVERFLOW) != 0;
    read.transmit_overflow = (controller & CAN_ERR_CRTL_TX_OVERFLOW) != 0;
    read.warning = (controller & (CAN_ERR_CRTL_RX_WARNING | CAN_ERR_CRTL_TX_WARNING)) != 0;
    read.passive = (controller & (CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE)) != 0;
    read.active_again = (controller & CAN_ERR_CRTL_ACTIVE) != 0;
  }
  read.transmit_errors = frame.data[6];
  read.receive_errors = frame.data[7];
  *error = read;
  return true;
}

std::string to_text(const BusError& error) {
  std::string text;
  const auto add = [&text](bool is, const char* words) {
    if (is) text += (text.empty() ? "" : "; ") + std::string(words);
  };
  add(error.bus_off, "bus-off: the controller has cut itself off");
  add(error.restarted, "the controller was restarted");
  add(error.no_acknowledge, "nobody acknowledges: no other node, or another bit rate");
  add(error.transmit_timeout, "a frame could not be sent in time");
  add(error.receive_overflow, "the controller's receive buffer overflowed");
  add(error.transmit_overflow, "the controller's transmit buffer overflowed");
  add(error.passive, "error passive");
  add(error.warning, "error warning");
  add(error.active_again, "error active again");
  add(error.protocol_violation, "a frame was damaged on the bus");
  add(error.lost_arbitration, "arbitration lost");
  if (text.empty()) text = "an error frame without a known cause";
  if (error.transmit_errors != 0 || error.receive_errors != 0) {
    text += " (transmit errors " + std::to_string(error.transmit_errors) + ", receive errors " +
            std::to_string(error.receive_errors) + ")";
  }
  return text;
}

}  // namespace vantage::can
