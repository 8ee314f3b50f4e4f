#include "drivers/can/can_frame.h"

#include <algorithm>
#include <cstring>

#include <linux/can.h>

namespace vantage::can {

static_assert(sizeof(can_frame) == kWireSize);

CanFrame make_frame(std::uint32_t id, std::span<const std::uint8_t> payload) {
  CanFrame frame;
  frame.id = id;
  frame.size = static_cast<std::uint8_t>(std::min(payload.size(), frame.data.size()));
  std::copy_n(payload.begin(), frame.size, frame.data.begin());
  return frame;
}

CanFrame make_frame(std::uint32_t id, std::initializer_list<std::uint8_t> payload) {
  return make_frame(id, std::span(payload.begin(), payload.size()));
}

bool same_on_wire(const CanFrame& a, const CanFrame& b) {
  return a.id == b.id && a.extended == b.extended && a.remote == b.remote && a.error == b.error && a.size == b.size &&
         std::equal(a.data.begin(), a.data.begin() + a.size, b.data.begin());
}

WireFrame write_wire(const CanFrame& frame) {
  can_frame wire{};
  wire.can_id = frame.id | (frame.extended ? CAN_EFF_FLAG : 0U) | (frame.remote ? CAN_RTR_FLAG : 0U) |
                (frame.error ? CAN_ERR_FLAG : 0U);
  wire.len = frame.size;
  std::memcpy(wire.data, frame.data.data(), frame.size);
  WireFrame bytes;
  std::memcpy(bytes.data(), &wire, sizeof wire);
  return bytes;
}

bool read_wire(std::span<const std::byte> bytes, CanFrame* frame) {
  can_frame wire{};
  if (bytes.size() != sizeof wire) return false;
  std::memcpy(&wire, bytes.data(), sizeof wire);
  if (wire.len > CAN_MAX_DLEN) return false;
  const bool extended = (wire.can_id & CAN_EFF_FLAG) != 0, error = (wire.can_id & CAN_ERR_FLAG) != 0;
  const std::uint32_t id = wire.can_id & CAN_EFF_MASK;
  if (!extended && !error && id > CAN_SFF_MASK) return false;
  CanFrame read;
  read.id = id;
  read.extended = extended;
  read.remote = (wire.can_id & CAN_RTR_FLAG) != 0;
  read.error = error;
  read.size = wire.len;
  std::memcpy(read.data.data(), wire.data, wire.len);
  *frame = read;
  return true;
}

}  // namespace vantage::can
