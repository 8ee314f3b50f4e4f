#include "lcmtypes/link/depth_map_sender.h"

#include <algorithm>
#include <cstring>

#include "lcmtypes/link/digest.h"

namespace vantage {
namespace {

/// Budget that may gather while `step` is not called: a longer burst would overrun the receiver's socket buffer.
constexpr double kLargestBurstBytes = 24 * 1024;

}  // namespace

DepthMapSender::DepthMapSender(MessageBus& bus, const Clock& clock, DepthMapSenderOptions options)
    : bus_(bus), clock_(clock), options_(options), last_step_(clock.monotonic()) {
  subscribe_message<depth_map_receipt_t>(bus_, channel::kDepthReceipt, &decode_,
                                         [this](const depth_map_receipt_t& receipt) { on_receipt(receipt); });
}

bool DepthMapSender::enqueue(const depth_map_t& map) {
  Parcel parcel;
  parcel.bytes = encode_message(map);
  parcel.manifest.session = map.session;
  parcel.manifest.map_id = map.map_id;
  parcel.manifest.bytes = static_cast<std::int32_t>(parcel.bytes.size());
  parcel.manifest.chunk_bytes = kChunkBytes;
  parcel.manifest.chunks = (parcel.manifest.bytes + kChunkBytes - 1) / kChunkBytes;
  const Digest digest = digest_of(parcel.bytes);
  std::copy(digest.begin(), digest.end(), parcel.manifest.digest);
  const bool full = spool_.size() >= options_.spool_maps;
  if (full) {
    spool_.pop_front();
    started_ = false;
    ++given_up_;
  }
  spool_.push_back(std::move(parcel));
  return !full;
}

void DepthMapSender::start_front() {
  Parcel& parcel = spool_.front();
  for (std::int32_t i = 0; i < parcel.manifest.chunks; ++i) parcel.due.push_back(i);
  started_ = true;
  send_manifest();
}

void DepthMapSender::step() {
  const std::chrono::nanoseconds now = clock_.monotonic();
  const double elapsed_s = std::chrono::duration<double>(now - last_step_).count();
  last_step_ = now;
  budget_bytes_ = std::min(budget_bytes_ + elapsed_s * options_.rate_bit_s / 8, kLargestBurstBytes);
  if (spool_.empty()) return;
  if (!started_) start_front();
  std::deque<std::int32_t>& due = spool_.front().due;
  while (!due.empty() && budget_bytes_ >= kChunkBytes) {
    send_chunk(due.front());
    due.pop_front();
  }
  if (due.empty() && now - last_word_ >= options_.ask_again) send_manifest();
}

void DepthMapSender::send_manifest() {
  depth_map_manifest_t& manifest = spool_.front().manifest;
  manifest.utime = clock_.utime();
  publish_message(bus_, channel::kDepthManifest, manifest);
  last_word_ = clock_.monotonic();
}

void DepthMapSender::send_chunk(std::int32_t index) {
  const Parcel& parcel = spool_.front();
  const std::size_t begin = static_cast<std::size_t>(index) * static_cast<std::size_t>(kChunkBytes);
  const std::size_t size = std::min(static_cast<std::size_t>(kChunkBytes), parcel.bytes.size() - begin);
  depth_map_chunk_t chunk;
  chunk.utime = clock_.utime();
  chunk.session = parcel.manifest.session;
  chunk.map_id = parcel.manifest.map_id;
  chunk.index = index;
  chunk.size = static_cast<std::int32_t>(size);
  chunk.data.assign(parcel.bytes.begin() + static_cast<std::ptrdiff_t>(begin),
                    parcel.bytes.begin() + static_cast<std::ptrdiff_t>(begin + size));
  publish_message(bus_, channel::kDepthChunk, chunk);
  budget_bytes_ -= static_cast<double>(size);
  last_word_ = clock_.monotonic();
  ++chunks_sent_;
}

void DepthMapSender::on_receipt(const depth_map_receipt_t& receipt) {
  if (spool_.empty() || !started_) return;
  Parcel& parcel = spool_.front();
  const depth_map_manifest_t& manifest = parcel.manifest;
  if (receipt.session != manifest.session || receipt.map_id != manifest.map_id ||
      std::memcmp(receipt.digest, manifest.digest, sizeof manifest.digest) != 0) {
    return;
  }
  if (receipt.complete != 0) {
    spool_.pop_front();
    started_ = false;
    ++acknowledged_;
    return;
  }
  if (!parcel.due.empty()) return;  // it may still lack only what has not been sent yet
  for (std::size_t range = 0; range < receipt.first.size(); ++range) {
    const std::int32_t last = std::min(receipt.last[range], manifest.chunks - 1);
    for (std::int32_t i = std::max(receipt.first[range], 0);
         i <= last && parcel.due.size() < static_cast<std::size_t>(manifest.chunks); ++i) {
      parcel.due.push_back(i);
    }
  }
}

}  // namespace vantage
