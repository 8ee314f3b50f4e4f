#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "lcmtypes/link/depth_map.h"
#include "lcmtypes/link/digest.h"
#include "lcmtypes/link/event_log.h"
#include "offboard/log/known_channels.h"

namespace vantage {

/// Takes a log's depth maps from its events: whole ones, and those that were recorded in chunks (of this and of earlier
/// versions).
class DepthMapGatherer {
 public:
  /// A map that was announced and never became whole.
  struct Incomplete {
    std::string place;  ///< of the first manifest, as given to `take`
    std::int64_t session = 0, map_id = 0;
    std::int64_t chunks = 0, missing = 0;
  };

  /// The depth map that this event completes. `fault` is not empty when the event holds or completes one that does not
  /// hold, or is an announcement that contradicts itself. `place` stands for the event in `incomplete`.
  /// \pre `message` was read from `event`
  std::optional<DepthMap> take(const LogEvent& event, const MessageFields& message, const std::string& place,
                               std::string* fault);

  std::vector<Incomplete> incomplete() const;
  std::int64_t assembled() const { return assembled_; }
  /// Chunks of maps that nobody announced: the log begins within their transfer.
  std::int64_t foreign_chunks() const { return foreign_chunks_; }

 private:
  struct Parcel {
    std::string place;
    std::int64_t session = 0, map_id = 0;
    Digest digest{};
    std::int64_t bytes = 0, chunk_bytes = 0, chunks = 0;
    std::map<std::int64_t, std::vector<std::uint8_t>> have;  // by index: memory for what came, not for what was claimed
    bool whole = false;
  };
  using MapKey = std::pair<std::int64_t, std::int64_t>;  // session, map id

  void on_manifest(const MessageFields& message, const std::string& place, std::string* fault);
  std::optional<DepthMap> on_chunk(const MessageFields& message, std::string* fault);

  std::map<MapKey, Parcel> parcels_;
  std::int64_t assembled_ = 0, foreign_chunks_ = 0;
};

}  // namespace vantage
