#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "lcmtypes/link/clock.h"
#include "lcmtypes/link/depth_map_spool.h"
#include "lcmtypes/link/message_bus.h"

namespace vantage {

/// Largest payload of one chunk: with its header the datagram stays below one Ethernet frame.
inline constexpr std::int32_t kChunkBytes = 1200 - 64;

struct DepthMapSenderOptions {
  double rate_bit_s = 100e6;                ///< of chunk payload
  std::size_t window_maps = 8;              ///< under way at once, so that waiting for a receipt costs no time
  std::chrono::milliseconds ask_again{30};  ///< so long after the last word on a map its manifest is sent again
  DepthMapSpoolOptions spool = {};
};

/// Brings depth maps to the other side whole or not at all.
///
/// The oldest maps of the spool are under way together: each is announced by its manifest, its chunks follow at the
/// configured rate, oldest map first, then whatever the receiver says it lacks, until the receiver acknowledges the
/// digest. A chunk is sent again only when something sent well after it has arrived, so that what is merely late is not
/// sent twice. Everything happens in the thread that calls `step` and `bus.handle`.
class DepthMapSender {
 public:
  /// \throws InputError as DepthMapSpool does.
  DepthMapSender(MessageBus& bus, const Clock& clock, const DepthMapSenderOptions& options = {});

  /// Takes a map for sending. False when the spool was full, so that its oldest maps were given up.
  /// \throws InputError when the spool's disk is full or gone.
  bool enqueue(const depth_map_t& map);

  /// Sends what the rate allows by now. Call it every millisecond or so.
  void step();

  /// Takes `bytes` off the rate's budget for something less urgent than depth maps. False: none to spare now.
  bool spare(std::size_t bytes);

  bool idle() const { return spool_.empty(); }
  const DepthMapSpool& spool() const { return spool_; }
  std::uint64_t acknowledged() const { return acknowledged_; }
  std::uint64_t chunks_sent() const { return chunks_sent_; }
  std::uint64_t chunks_sent_again() const { return chunks_sent_again_; }
  const DecodeCounters& decode_counters() const { return decode_; }

 private:
  /// A map under way; `flights_[i]` belongs to `spool_[i]`.
  struct Flight {
    depth_map_manifest_t manifest;
    std::deque<std::int32_t> due;        // chunks to send, in order
    std::vector<bool> queued;            // of each chunk: in `due`
    std::vector<std::int64_t> sent_at;   // of each chunk: when it was sent last, us; 0: not yet
    bool known = false;                  // the receiver has answered the manifest
    std::int32_t unanswered_chunks = 0;  // sent since the last manifest, while it is not known
    std::chrono::nanoseconds last_word{0};
  };

  void take_off();
  std::optional<std::size_t> next_flight() const;
  std::int64_t stamp() const;
  void on_receipt(const depth_map_receipt_t& receipt);
  void send_manifest(Flight* flight);
  void send_chunk(std::size_t index);

  MessageBus& bus_;
  const Clock& clock_;
  DepthMapSenderOptions options_;
  DecodeCounters decode_;
  DepthMapSpool spool_;
  std::deque<Flight> flights_;
  std::int64_t stamp_offset_us_;
  double budget_bytes_ = 0;
  std::chrono::nanoseconds last_step_{0};
  std::uint64_t acknowledged_ = 0, chunks_sent_ = 0, chunks_sent_again_ = 0;
};

}  // namespace vantage
