#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <span>

namespace vantage::can {

/// A classic CAN frame, or an error frame of the controller.
struct CanFrame {
  std::uint32_t id = 0;  ///< 11 bits, 29 when extended; of an error frame the error classes (linux/can/error.h)
  bool extended = false;
  bool remote = false;
  bool error = false;
  std::uint8_t size = 0;  ///< bytes of `data` that count, 0 to 8
  std::array<std::uint8_t, 8> data{};
  std::chrono::nanoseconds time{0};  ///< CLOCK_MONOTONIC of its arrival; not sent, not compared

  std::span<const std::uint8_t> payload() const { return {data.data(), size}; }
};

/// A data frame with an 11-bit identifier. \pre id <= 0x7FF and at most 8 bytes.
CanFrame make_frame(std::uint32_t id, std::span<const std::uint8_t> payload);
CanFrame make_frame(std::uint32_t id, std::initializer_list<std::uint8_t> payload);

/// True when both would look the same on the wire.
bool same_on_wire(const CanFrame& a, const CanFrame& b);

/// Bytes of the kernel's `struct can_frame`, which is also one datagram on a simulated bus.
inline constexpr std::size_t kWireSize = 16;
using WireFrame = std::array<std::byte, kWireSize>;

/// As the kernel lays a frame out, in this machine's byte order.
WireFrame write_wire(const CanFrame& frame);

/// Reads what `write_wire` or the kernel wrote. False, and `frame` untouched, when the length is not a frame's, the
/// payload is longer than 8 bytes, or an identifier without the extended flag has more than 11 bits.
bool read_wire(std::span<const std::byte> wire, CanFrame* frame);

}  // namespace vantage::can
