#pragma once

#include <chrono>
#include <cstdint>
#include <span>
#include <string>

#include "drivers/can/can_frame.h"

namespace vantage::can {

enum class SendResult {
  kSent,
  kQueueFull,  ///< the transmit queue is full (ENOBUFS): in a cyclic loop a fault, never a reason to try again
  kDown,       ///< the interface is set down; it may come back
  kGone        ///< the interface or the other side does not exist any more
};

enum class ReceiveResult { kFrame, kNothing, kDown, kGone };

struct BusCounters {
  std::uint64_t sent = 0, received = 0;
  std::uint64_t refused_sends = 0;  ///< any result of `send` but kSent
  std::uint64_t overflowed = 0;     ///< frames lost because nobody took them from the receive queue in time
  std::uint64_t malformed = 0;      ///< what came in and is no frame
  std::uint64_t odd_stamps = 0;     ///< time stamps that could not be (in the future, or older than a second)
};

/// A classic CAN bus: SocketCAN, a Unix socket between programs of one machine, or the memory of one process.
///
/// Every call but the waits returns at once and allocates nothing. One thread at a time uses a bus. Times are those of
/// CLOCK_MONOTONIC, or of the clock that a bus in memory was given.
class CanBus {
 public:
  virtual ~CanBus() = default;

  virtual SendResult send(const CanFrame& frame) = 0;
  /// The next frame that came in; the own ones do not. Error frames of the controller come in as well.
  virtual ReceiveResult receive(CanFrame* frame) = 0;
  /// Waits until something can be received. False when nothing came before `deadline`.
  virtual bool wait_until(std::chrono::nanoseconds deadline) = 0;
  /// Waits until `deadline`, whatever comes in.
  virtual void sleep_until(std::chrono::nanoseconds deadline) = 0;
  /// Receives exactly these 11-bit identifiers from now on, and error frames.
  virtual void accept_only(std::span<const std::uint32_t> ids) = 0;
  /// Asks the controller to come back from bus-off. False, with the reason in `why`, when it can't be asked.
  virtual bool restart(std::string* why) = 0;

  virtual const BusCounters& counters() const = 0;
  /// As a person named it: "can0".
  virtual std::string name() const = 0;
};

}  // namespace vantage::can
