#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <vector>

#include "lcmtypes/link/clock.h"
#include "lcmtypes/link/message_bus.h"

namespace vantage {

/// Largest payload of one chunk: with its header the datagram stays below one Ethernet frame.
inline constexpr std::int32_t kChunkBytes = 1200 - 64;

struct DepthMapSenderOptions {
  double rate_bit_s = 100e6;                 ///< of chunk payload
  std::size_t spool_maps = 8;                ///< unacknowledged maps kept; the oldest leaves when one more comes
  std::chrono::milliseconds ask_again{100};  ///< without a receipt for so long, the manifest is sent again
};

/// Brings depth maps to the other side whole or not at all, in the order in which they were given.
///
/// One map at a time: its manifest, its chunks at the configured rate, then whatever ranges the receiver says it lacks,
/// until the receiver acknowledges the digest. Everything happens in the thread that calls `step` and `bus.handle`.
class DepthMapSender {
 public:
  DepthMapSender(MessageBus& bus, const Clock& clock, DepthMapSenderOptions options = {});

  /// Takes a map for sending. False when the spool was full, so that its oldest map was given up.
  bool enqueue(const depth_map_t& map);

  /// Sends what the rate allows by now. Call it every millisecond or so.
  void step();

  bool idle() const { return spool_.empty(); }
  std::uint64_t acknowledged() const { return acknowledged_; }
  std::uint64_t given_up() const { return given_up_; }
  std::uint64_t chunks_sent() const { return chunks_sent_; }
  const DecodeCounters& decode_counters() const { return decode_; }

 private:
  struct Parcel {
    depth_map_manifest_t manifest;
    std::vector<std::uint8_t> bytes;
    std::deque<std::int32_t> due;  // chunks to send, in order
  };

  void start_front();
  void on_receipt(const depth_map_receipt_t& receipt);
  void send_manifest();
  void send_chunk(std::int32_t index);

  MessageBus& bus_;
  const Clock& clock_;
  DepthMapSenderOptions options_;
  DecodeCounters decode_;
  std::deque<Parcel> spool_;
  bool started_ = false;  // the front parcel's manifest has been sent
  double budget_bytes_ = 0;
  std::chrono::nanoseconds last_step_{0}, last_word_{0};
  std::uint64_t acknowledged_ = 0, given_up_ = 0, chunks_sent_ = 0;
};

}  // namespace vantage
