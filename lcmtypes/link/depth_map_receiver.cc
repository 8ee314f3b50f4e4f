#include "lcmtypes/link/depth_map_receiver.h"

#include <algorithm>
#include <cstring>

namespace vantage {
namespace {

constexpr std::size_t kRemembered = 64;   // finished maps whose receipt can be given again
constexpr std::size_t kMostRanges = 120;  // so that a receipt fits one datagram of 1,200 bytes

bool same_digest(const std::uint8_t* a, const Digest& b) { return std::equal(b.begin(), b.end(), a); }

bool consistent(const depth_map_manifest_t& m, std::int32_t most_bytes) {
  return m.bytes > 0 && m.bytes <= most_bytes && m.chunk_bytes > 0 &&
         m.chunks == (std::int64_t{m.bytes} + m.chunk_bytes - 1) / m.chunk_bytes;
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

void DepthMapReceiver::on_manifest(const depth_map_manifest_t& manifest) {
  if (!consistent(manifest, options_.most_bytes)) {
    ++counters_.refused_manifests;
    return;
  }
  const MapKey key{manifest.session, manifest.map_id};
  for (const auto& [finished, digest] : finished_) {
    if (finished == key && same_digest(manifest.digest, digest)) return send_receipt(manifest, true);
  }
  if (parcel_ && std::memcmp(parcel_->manifest.digest, manifest.digest, sizeof manifest.digest) == 0) {
    return send_receipt(manifest, false);  // the sender asks: it has sent all it thinks we lack
  }
  parcel_ = Parcel{manifest, std::vector<std::uint8_t>(static_cast<std::size_t>(manifest.bytes)),
                   std::vector<bool>(static_cast<std::size_t>(manifest.chunks)), manifest.chunks};
  last_receipt_ = clock_.monotonic();
}

void DepthMapReceiver::on_chunk(const depth_map_chunk_t& chunk) {
  const depth_map_manifest_t* manifest = parcel_ ? &parcel_->manifest : nullptr;
  if (manifest == nullptr || chunk.session != manifest->session || chunk.map_id != manifest->map_id ||
      chunk.index < 0 || chunk.index >= manifest->chunks) {
    ++counters_.foreign_chunks;
    return;
  }
  const auto index = static_cast<std::size_t>(chunk.index);
  const std::size_t begin = index * static_cast<std::size_t>(manifest->chunk_bytes);
  const std::size_t size = std::min(static_cast<std::size_t>(manifest->chunk_bytes), parcel_->bytes.size() - begin);
  if (chunk.data.size() != size) {
    ++counters_.foreign_chunks;
    return;
  }
  if (parcel_->have[index]) {
    ++counters_.duplicate_chunks;
    return;
  }
  std::copy(chunk.data.begin(), chunk.data.end(), parcel_->bytes.begin() + static_cast<std::ptrdiff_t>(begin));
  parcel_->have[index] = true;
  if (--parcel_->missing == 0) finish();
}

void DepthMapReceiver::finish() {
  depth_map_t map;
  if (!same_digest(parcel_->manifest.digest, digest_of(parcel_->bytes)) ||
      !decode_message(parcel_->bytes, &map, &decode_)) {
    ++counters_.wrong_digests;  // some chunk was forged or damaged; there is no telling which
    parcel_->have.assign(parcel_->have.size(), false);
    parcel_->missing = parcel_->manifest.chunks;
    return;
  }
  const depth_map_manifest_t manifest = parcel_->manifest;
  parcel_.reset();
  remember({manifest.session, manifest.map_id}, manifest.digest);
  ++counters_.delivered;
  handler_(map);
  send_receipt(manifest, true);  // after the handler: what is acknowledged has been taken over
}

void DepthMapReceiver::remember(const MapKey& key, const std::uint8_t* digest) {
  Digest kept;
  std::copy_n(digest, kept.size(), kept.begin());
  finished_.emplace_back(key, kept);
  if (finished_.size() > kRemembered) finished_.pop_front();
}

void DepthMapReceiver::step() {
  if (!parcel_ || clock_.monotonic() - last_receipt_ < options_.ask_again) return;
  send_receipt(parcel_->manifest, false);
}

void DepthMapReceiver::send_receipt(const depth_map_manifest_t& manifest, bool complete) {
  depth_map_receipt_t receipt;
  receipt.utime = clock_.utime();
  receipt.session = manifest.session;
  receipt.map_id = manifest.map_id;
  receipt.complete = complete ? 1 : 0;
  std::copy_n(manifest.digest, sizeof manifest.digest, receipt.digest);
  if (!complete) {
    const std::vector<bool>& have = parcel_->have;
    for (std::size_t i = 0; i < have.size() && receipt.first.size() < kMostRanges; ++i) {
      if (have[i]) continue;
      receipt.first.push_back(static_cast<std::int32_t>(i));
      while (i + 1 < have.size() && !have[i + 1]) ++i;
      receipt.last.push_back(static_cast<std::int32_t>(i));
    }
  }
  receipt.ranges = static_cast<std::int32_t>(receipt.first.size());
  publish_message(bus_, channel::kDepthReceipt, receipt);
  last_receipt_ = clock_.monotonic();
}

}  // namespace vantage
