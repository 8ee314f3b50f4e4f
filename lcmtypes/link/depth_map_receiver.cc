#include "lcmtypes/link/depth_map_receiver.h"

#include <algorithm>
#include <cstring>

namespace vantage {
namespace {

constexpr std::size_t kRemembered = 1024;  // finished maps whose receipt can be given again
constexpr std::size_t kMostRanges = 120;   // so that a receipt fits one datagram of 1,200 bytes
constexpr std::size_t kMostSenders = 8;

bool same_digest(const std::uint8_t* a, const Digest& b) { return std::equal(b.begin(), b.end(), a); }

bool consistent(const depth_map_manifest_t& m, std::int32_t most_bytes) {
  return m.bytes > 0 && m.bytes <= most_bytes && m.chunk_bytes > 0 &&
         m.chunks == (std::int64_t{m.bytes} + m.chunk_bytes - 1) / m.chunk_bytes && m.oldest_map_id <= m.map_id;
}

template <typename Map, typename Silence>
auto most_silent(Map& map, Silence last_word) {
  return std::min_element(map.begin(), map.end(),
                          [&](const auto& a, const auto& b) { return last_word(a.second) < last_word(b.second); });
}

}  // namespace

DepthMapReceiver::DepthMapReceiver(MessageBus& bus, const Clock& clock, Handler handler,
                                   DepthMapReceiverOptions options)
    : bus_(bus), clock_(clock), handler_(std::move(handler)), options_(options) {
  subscribe_message<depth_map_manifest_t>(bus_, channel::kDepthManifest, &decode_,
                                          [this](const depth_map_manifest_t& m) { on_manifest(m); });
  subscribe_message<depth_map_chunk_t>(bus_, channel::kDepthChunk, &decode_,
                                       [this](const depth_map_chunk_t& c) { on_chunk(c); });
  subscribe_message<depth_map_t>(bus_, channel::kDepthMap, &decode_, [this](const depth_map_t& map) {
    ++counters_.delivered;
    handler_(map);
  });
}

DepthMapReceiver::SenderState& DepthMapReceiver::hear(std::int64_t session, std::int64_t stamp) {
  if (!senders_.contains(session) && senders_.size() >= kMostSenders) {
    senders_.erase(most_silent(senders_, [](const SenderState& s) { return s.last_word; }));
  }
  SenderState& sender = senders_[session];
  sender.heard = std::max(sender.heard, stamp);
  sender.last_word = clock_.monotonic();
  return sender;
}

void DepthMapReceiver::on_manifest(const depth_map_manifest_t& manifest) {
  if (!consistent(manifest, options_.most_bytes)) {
    ++counters_.refused_manifests;
    return;
  }
  const MapKey key{manifest.session, manifest.map_id};
  SenderState& sender = hear(manifest.session, manifest.utime);
  sender.oldest_map_id = std::max(sender.oldest_map_id, manifest.oldest_map_id);  // it only rises; words overtake
  const auto known = parcels_.find(key);
  if (const auto done = finished_.find(key); done != finished_.end() && same_digest(manifest.digest, done->second)) {
    send_receipt(manifest, nullptr);
  } else if (known != parcels_.end() &&
             std::memcmp(known->second.manifest.digest, manifest.digest, sizeof manifest.digest) == 0) {
    known->second.last_word = clock_.monotonic();
    send_receipt(manifest, &known->second);  // the sender asks: it has sent all it thinks we lack
  } else {
    if (known != parcels_.end()) {
      parcel_bytes_ -= known->second.manifest.bytes;
      parcels_.erase(known);
    }
    if (!make_room(manifest.bytes)) return;
    Parcel& parcel = parcels_[key];
    parcel.manifest = manifest;
    parcel.bytes.resize(static_cast<std::size_t>(manifest.bytes));
    parcel.have.resize(static_cast<std::size_t>(manifest.chunks));
    parcel.missing = manifest.chunks;
    parcel.last_word = clock_.monotonic();
    parcel_bytes_ += manifest.bytes;
    send_receipt(manifest, &parcel);
  }
  deliver_in_order(manifest.session);  // one may have waited for an older map that the sender has given up
}

/// False when even an empty table has no room.
bool DepthMapReceiver::make_room(std::int64_t bytes) {
  while (!parcels_.empty() &&
         (parcels_.size() >= options_.most_parcels || parcel_bytes_ + bytes > options_.most_total_bytes)) {
    const auto parcel = most_silent(parcels_, [](const Parcel& p) { return p.last_word; });
    parcel_bytes_ -= parcel->second.manifest.bytes;
    parcels_.erase(parcel);
    ++counters_.set_aside;
  }
  return bytes <= options_.most_total_bytes;
}

void DepthMapReceiver::on_chunk(const depth_map_chunk_t& chunk) {
  const MapKey key{chunk.session, chunk.map_id};
  const auto found = parcels_.find(key);
  if (found == parcels_.end() || chunk.index < 0 || chunk.index >= found->second.manifest.chunks) {
    ++(finished(key) ? counters_.duplicate_chunks : counters_.foreign_chunks);
    return;
  }
  Parcel& parcel = found->second;
  const auto index = static_cast<std::size_t>(chunk.index);
  const std::size_t begin = index * static_cast<std::size_t>(parcel.manifest.chunk_bytes);
  const std::size_t size = std::min(static_cast<std::size_t>(parcel.manifest.chunk_bytes), parcel.bytes.size() - begin);
  if (chunk.data.size() != size) {
    ++counters_.foreign_chunks;
    return;
  }
  hear(chunk.session, chunk.utime);
  parcel.last_word = clock_.monotonic();
  if (parcel.have[index]) {
    ++counters_.duplicate_chunks;
    return;
  }
  std::copy(chunk.data.begin(), chunk.data.end(), parcel.bytes.begin() + static_cast<std::ptrdiff_t>(begin));
  parcel.have[index] = true;
  if (--parcel.missing > 0) return;
  check_digest(&parcel);
  deliver_in_order(key.first);
}

void DepthMapReceiver::check_digest(Parcel* parcel) {
  if (same_digest(parcel->manifest.digest, digest_of(parcel->bytes))) return;
  ++counters_.wrong_digests;  // some chunk was forged or damaged; there is no telling which
  parcel->have.assign(parcel->have.size(), false);
  parcel->missing = parcel->manifest.chunks;
}

/// Hands over the whole maps of a session that no older one holds up.
void DepthMapReceiver::deliver_in_order(std::int64_t session) {
  const auto sender = senders_.find(session);
  const std::int64_t oldest = sender == senders_.end() ? 0 : sender->second.oldest_map_id;
  std::int64_t next = oldest;
  for (;;) {
    const auto parcel = parcels_.lower_bound({session, INT64_MIN});
    if (parcel == parcels_.end() || parcel->first.first != session) return;
    const std::int64_t id = parcel->first.second;
    while (next < id && finished({session, next})) ++next;
    if (parcel->second.missing == 0 && next >= id) {
      deliver(parcel->first);
    } else if (id < oldest) {  // its sender has given it up
      parcel_bytes_ -= parcel->second.manifest.bytes;
      parcels_.erase(parcel);
      ++counters_.given_up;
    } else {
      return;
    }
  }
}

void DepthMapReceiver::deliver(MapKey key) {  // a copy: its parcel goes
  const auto found = parcels_.find(key);
  const Parcel parcel = std::move(found->second);
  parcel_bytes_ -= parcel.manifest.bytes;
  parcels_.erase(found);
  depth_map_t map;
  if (decode_message(parcel.bytes, &map, &decode_)) {  // else what was announced is no depth map, now or ever
    ++counters_.delivered;
    handler_(map);
  }
  Digest digest;
  std::copy_n(parcel.manifest.digest, digest.size(), digest.begin());
  remember(key.first, key.second, digest);
  send_receipt(parcel.manifest, nullptr);  // after the handler: what is acknowledged has been taken over
}

void DepthMapReceiver::remember(std::int64_t session, std::int64_t map_id, const Digest& digest) {
  const MapKey key{session, map_id};
  if (finished_.insert_or_assign(key, digest).second) finished_order_.push_back(key);
  if (finished_order_.size() > kRemembered) {
    finished_.erase(finished_order_.front());
    finished_order_.pop_front();
  }
}

void DepthMapReceiver::step() {
  const std::chrono::nanoseconds now = clock_.monotonic();
  for (auto& [key, parcel] : parcels_) {
    if (parcel.missing > 0 && now - parcel.last_receipt >= options_.ask_again) send_receipt(parcel.manifest, &parcel);
  }
}

/// Of an unfinished map what it lacks; without a parcel: all of it is here.
void DepthMapReceiver::send_receipt(const depth_map_manifest_t& manifest, Parcel* parcel) {
  depth_map_receipt_t receipt;
  receipt.utime = clock_.utime();
  receipt.session = manifest.session;
  receipt.map_id = manifest.map_id;
  receipt.heard = senders_[manifest.session].heard;
  receipt.complete = parcel == nullptr ? 1 : 0;
  std::copy_n(manifest.digest, sizeof manifest.digest, receipt.digest);
  if (parcel != nullptr) {
    const std::vector<bool>& have = parcel->have;
    for (std::size_t i = 0; i < have.size() && receipt.first.size() < kMostRanges; ++i) {
      if (have[i]) continue;
      receipt.first.push_back(static_cast<std::int32_t>(i));
      while (i + 1 < have.size() && !have[i + 1]) ++i;
      receipt.last.push_back(static_cast<std::int32_t>(i));
    }
    parcel->last_receipt = clock_.monotonic();
  }
  receipt.ranges = static_cast<std::int32_t>(receipt.first.size());
  publish_message(bus_, channel::kDepthReceipt, receipt);
}

}  // namespace vantage
