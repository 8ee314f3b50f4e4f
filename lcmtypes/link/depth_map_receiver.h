#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "lcmtypes/link/clock.h"
#include "lcmtypes/link/digest.h"
#include "lcmtypes/link/message_bus.h"

namespace vantage {

struct DepthMapReceiverOptions {
  std::int32_t most_bytes = 16 << 20;       ///< of one encoded map; a larger claim is refused before memory is taken
  std::chrono::milliseconds ask_again{50};  ///< how often missing ranges are asked for
};

/// The other end of DepthMapSender: gathers chunks, asks for what is missing, checks the digest, acknowledges, and
/// hands each map over once. Also takes maps that come whole (from a log).
///
/// Everything happens in the thread that calls `step` and `bus.handle`. Holds one unfinished map at a time: the sender
/// sends one at a time.
class DepthMapReceiver {
 public:
  using Handler = std::function<void(const depth_map_t&)>;

  struct Counters {
    std::uint64_t delivered = 0;
    std::uint64_t duplicate_chunks = 0;   ///< came again, as they may
    std::uint64_t foreign_chunks = 0;     ///< of no announced map, or not of its shape
    std::uint64_t refused_manifests = 0;  ///< claims that contradict themselves or the limits
    std::uint64_t wrong_digests = 0;      ///< whole, but not what was announced: asked for anew
  };

  DepthMapReceiver(MessageBus& bus, const Clock& clock, Handler handler, DepthMapReceiverOptions options = {});

  /// Asks for missing ranges when it is time. Call it every few milliseconds.
  void step();

  const Counters& counters() const { return counters_; }
  const DecodeCounters& decode_counters() const { return decode_; }

 private:
  struct Parcel {
    depth_map_manifest_t manifest;
    std::vector<std::uint8_t> bytes;
    std::vector<bool> have;
    std::int32_t missing;
  };
  using MapKey = std::pair<std::int64_t, std::int64_t>;  // session, map id

  void on_manifest(const depth_map_manifest_t& manifest);
  void on_chunk(const depth_map_chunk_t& chunk);
  void finish();
  void remember(const MapKey& key, const std::uint8_t* digest);
  void send_receipt(const depth_map_manifest_t& manifest, bool complete);

  MessageBus& bus_;
  const Clock& clock_;
  Handler handler_;
  DepthMapReceiverOptions options_;
  DecodeCounters decode_;
  Counters counters_;
  std::optional<Parcel> parcel_;
  std::deque<std::pair<MapKey, Digest>> finished_;  // the latest, so that a lost receipt can be given again
  std::chrono::nanoseconds last_receipt_{0};
};

}  // namespace vantage
