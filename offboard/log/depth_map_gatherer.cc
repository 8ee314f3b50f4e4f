#include "offboard/log/depth_map_gatherer.h"

#include <algorithm>
#include <utility>

#include "lcmtypes/link/depth_codec.h"
#include "lcmtypes/link/message.h"

namespace vantage {
namespace {

constexpr std::int64_t kMostMapBytes = 16 << 20;  // as DepthMapReceiver takes

std::optional<DepthMap> unpack(std::span<const std::uint8_t> bytes, std::string* fault) {
  depth_map_t message;
  DecodeCounters counters;
  if (!decode_message(bytes, &message, &counters)) {
    *fault = "the depth map does not decode";
    return std::nullopt;
  }
  return unpack_depth_map(message, fault);
}

}  // namespace

std::optional<DepthMap> DepthMapGatherer::take(const LogEvent& event, const MessageFields& message,
                                               const std::string& place, std::string* fault) {
  const std::string_view type = find_channel(event.channel)->type;
  if (type == depth_map_t::getTypeName()) return unpack(message.body(), fault);
  if (type == depth_map_manifest_t::getTypeName()) on_manifest(message, place, fault);
  if (type == depth_map_chunk_t::getTypeName()) return on_chunk(message, fault);
  return std::nullopt;
}

void DepthMapGatherer::on_manifest(const MessageFields& message, const std::string& place, std::string* fault) {
  const std::int64_t bytes = message.find("bytes")->integer(), chunk_bytes = message.find("chunk_bytes")->integer();
  const std::int64_t chunks = message.find("chunks")->integer();
  if (bytes <= 0 || bytes > kMostMapBytes || chunk_bytes <= 0 || chunks != (bytes + chunk_bytes - 1) / chunk_bytes) {
    *fault = "the announced sizes contradict themselves";
    return;
  }
  Parcel parcel;
  parcel.place = place;
  parcel.session = message.find("session")->integer();
  parcel.map_id = message.find("map_id")->integer();
  const std::span<const std::uint8_t> digest = message.find("digest")->bytes;
  std::copy(digest.begin(), digest.end(), parcel.digest.begin());
  const auto known = parcels_.find({parcel.session, parcel.map_id});
  if (known != parcels_.end() && known->second.digest == parcel.digest) return;  // said again
  parcel.bytes = bytes;
  parcel.chunk_bytes = chunk_bytes;
  parcel.chunks = chunks;
  parcels_[{parcel.session, parcel.map_id}] = std::move(parcel);
}

std::optional<DepthMap> DepthMapGatherer::on_chunk(const MessageFields& message, std::string* fault) {
  const auto found = parcels_.find({message.find("session")->integer(), message.find("map_id")->integer()});
  if (found == parcels_.end()) {
    ++foreign_chunks_;
    return std::nullopt;
  }
  Parcel& parcel = found->second;
  const std::int64_t index = message.find("index")->integer();
  const std::span<const std::uint8_t> data = message.find("data")->bytes;
  if (index < 0 || index >= parcel.chunks) {
    *fault = "there is no chunk " + std::to_string(index) + " in the announced map";
    return std::nullopt;
  }
  const std::int64_t size = std::min(parcel.chunk_bytes, parcel.bytes - index * parcel.chunk_bytes);
  if (static_cast<std::int64_t>(data.size()) != size) {
    *fault = "chunk " + std::to_string(index) + " is not of the announced size";
    return std::nullopt;
  }
  if (parcel.whole) return std::nullopt;  // came again, as they may
  parcel.have.try_emplace(index, data.begin(), data.end());
  if (static_cast<std::int64_t>(parcel.have.size()) < parcel.chunks) return std::nullopt;
  parcel.whole = true;
  std::vector<std::uint8_t> bytes;
  for (const auto& [number, chunk] : std::exchange(parcel.have, {}))
    bytes.insert(bytes.end(), chunk.begin(), chunk.end());
  if (digest_of(bytes) != parcel.digest) {
    *fault = "depth map " + std::to_string(parcel.map_id) + " is whole but not what was announced (its digest differs)";
    return std::nullopt;
  }
  ++assembled_;
  return unpack(bytes, fault);
}

std::vector<DepthMapGatherer::Incomplete> DepthMapGatherer::incomplete() const {
  std::vector<Incomplete> all;
  for (const auto& [key, parcel] : parcels_) {
    if (parcel.whole) continue;
    const auto have = static_cast<std::int64_t>(parcel.have.size());
    all.push_back({parcel.place, key.first, key.second, parcel.chunks, parcel.chunks - have});
  }
  return all;
}

}  // namespace vantage
