#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "lcmtypes/link/clock.h"
#include "lcmtypes/link/digest.h"
#include "lcmtypes/link/message_bus.h"

namespace vantage {

struct DepthMapReceiverOptions {
  std::int32_t most_bytes = 16 << 20;        ///< of one encoded map; a larger claim is refused before memory is taken
  std::size_t most_parcels = 32;             ///< unfinished maps at a time; the one that was silent longest makes way
  std::int64_t most_total_bytes = 64 << 20;  ///< of all unfinished maps together, likewise
  std::chrono::milliseconds ask_again{50};   ///< how often missing ranges are asked for
};

/// The other end of DepthMapSender: gathers chunks, asks for what is missing, checks the digest, hands each map over
/// once and acknowledges it then. Also takes maps that come whole (from a log).
///
/// Maps of one session are handed over in the order of their ids: one that is whole waits for older ones that its
/// sender still has. Everything happens in the thread that calls `step` and `bus.handle`.
class DepthMapReceiver {
 public:
  /// What the handler has returned from is acknowledged: by then it must be where it can't be lost.
  using Handler = std::function<void(const depth_map_t&)>;

  struct Counters {
    std::uint64_t delivered = 0;
    std::uint64_t duplicate_chunks = 0;   ///< came again, as they may
    std::uint64_t foreign_chunks = 0;     ///< of no announced map, or not of its shape
    std::uint64_t refused_manifests = 0;  ///< claims that contradict themselves or the limits
    std::uint64_t wrong_digests = 0;      ///< whole, but not what was announced: asked for anew
    std::uint64_t set_aside = 0;          ///< unfinished maps that made way for others
    std::uint64_t given_up = 0;           ///< unfinished maps that their sender no longer has
  };

  DepthMapReceiver(MessageBus& bus, const Clock& clock, Handler handler, DepthMapReceiverOptions options = {});

  /// Asks for missing ranges when it is time. Call it every few milliseconds.
  void step();

  /// A map that was handed over in an earlier life of this program: it is acknowledged, not handed over again.
  void remember(std::int64_t session, std::int64_t map_id, const Digest& digest);

  const Counters& counters() const { return counters_; }
  const DecodeCounters& decode_counters() const { return decode_; }

 private:
  using MapKey = std::pair<std::int64_t, std::int64_t>;  // session, map id

  struct Parcel {
    depth_map_manifest_t manifest;
    std::vector<std::uint8_t> bytes;
    std::vector<bool> have;
    std::int32_t missing = 0;
    std::chrono::nanoseconds last_receipt{0}, last_word{0};
  };

  /// What is known of one start of the sender.
  struct SenderState {
    std::int64_t heard = 0;          // the latest stamp that came
    std::int64_t oldest_map_id = 0;  // that it still has
    std::chrono::nanoseconds last_word{0};
  };

  void on_manifest(const depth_map_manifest_t& manifest);
  void on_chunk(const depth_map_chunk_t& chunk);
  bool make_room(std::int64_t bytes);
  SenderState& hear(std::int64_t session, std::int64_t stamp);
  void check_digest(Parcel* parcel);
  void deliver_in_order(std::int64_t session);
  void deliver(MapKey key);
  bool finished(const MapKey& key) const { return finished_.contains(key); }
  void send_receipt(const depth_map_manifest_t& manifest, Parcel* parcel);

  MessageBus& bus_;
  const Clock& clock_;
  Handler handler_;
  DepthMapReceiverOptions options_;
  DecodeCounters decode_;
  Counters counters_;
  std::map<MapKey, Parcel> parcels_;
  std::int64_t parcel_bytes_ = 0;
  std::map<std::int64_t, SenderState> senders_;  // by session; few
  std::map<MapKey, Digest> finished_;            // the latest, so that a lost receipt can be given again
  std::deque<MapKey> finished_order_;
};

}  // namespace vantage
