#include "lcmtypes/link/depth_map_sender.h"

#include <algorithm>
#include <cstring>

namespace vantage {
namespace {

/// Budget that may gather while `step` is not called: a longer burst would overrun the receiver's socket buffer.
constexpr double kLargestBurstBytes = 24 * 1024;

/// A chunk counts as lost when something sent so much later has arrived: networks reorder within less.
constexpr std::int64_t kReordering_us = 10'000;

/// While the receiver has not answered, the manifest goes out again after so many chunks: chunks of a map that it does
/// not know are lost on it.
constexpr std::int32_t kChunksBetweenManifests = 16;

}  // namespace

DepthMapSender::DepthMapSender(MessageBus& bus, const Clock& clock, const DepthMapSenderOptions& options)
    : bus_(bus),
      clock_(clock),
      options_(options),
      spool_(options.spool),
      stamp_offset_us_(clock.utime() -
                       std::chrono::duration_cast<std::chrono::microseconds>(clock.monotonic()).count()),
      last_step_(clock.monotonic()) {
  subscribe_message<depth_map_receipt_t>(bus_, channel::kDepthReceipt, &decode_,
                                         [this](const depth_map_receipt_t& receipt) { on_receipt(receipt); });
}

bool DepthMapSender::enqueue(const depth_map_t& map) {
  const std::uint64_t given_up = spool_.given_up();
  const auto forget_given_up = [&] {
    const std::uint64_t gone = spool_.given_up() - given_up;
    for (std::uint64_t i = 0; i < gone && !flights_.empty(); ++i) flights_.pop_front();
    return gone;
  };
  try {
    spool_.push(map);
  } catch (...) {
    forget_given_up();
    throw;
  }
  return forget_given_up() == 0;
}

/// Announces the maps that have come into the window.
void DepthMapSender::take_off() {
  while (flights_.size() < std::min(options_.window_maps, spool_.size())) {
    const DepthMapSpool::Entry& entry = spool_[flights_.size()];
    Flight flight;
    flight.manifest.session = entry.session;
    flight.manifest.map_id = entry.map_id;
    flight.manifest.bytes = static_cast<std::int32_t>(entry.bytes.size());
    flight.manifest.chunk_bytes = kChunkBytes;
    flight.manifest.chunks = (flight.manifest.bytes + kChunkBytes - 1) / kChunkBytes;
    std::copy(entry.digest.begin(), entry.digest.end(), flight.manifest.digest);
    const auto chunks = static_cast<std::size_t>(flight.manifest.chunks);
    for (std::int32_t i = 0; i < flight.manifest.chunks; ++i) flight.due.push_back(i);
    flight.queued.assign(chunks, true);
    flight.sent_at.assign(chunks, 0);
    flights_.push_back(std::move(flight));
    send_manifest(&flights_.back());
  }
}

/// The oldest map that has chunks to send and is known to the receiver, else the oldest that has any.
std::optional<std::size_t> DepthMapSender::next_flight() const {
  std::optional<std::size_t> unknown;
  for (std::size_t i = 0; i < flights_.size(); ++i) {
    if (flights_[i].due.empty()) continue;
    if (flights_[i].known) return i;
    if (!unknown) unknown = i;
  }
  return unknown;
}

void DepthMapSender::step() {
  const std::chrono::nanoseconds now = clock_.monotonic();
  const double elapsed_s = std::chrono::duration<double>(now - last_step_).count();
  last_step_ = now;
  budget_bytes_ = std::min(budget_bytes_ + elapsed_s * options_.rate_bit_s / 8, kLargestBurstBytes);
  take_off();
  while (budget_bytes_ >= kChunkBytes) {
    const std::optional<std::size_t> next = next_flight();
    if (!next) break;
    Flight& flight = flights_[*next];
    if (!flight.known && ++flight.unanswered_chunks > kChunksBetweenManifests) send_manifest(&flight);
    send_chunk(*next);
    if (flight.due.empty()) send_manifest(&flight);  // asks what is missing
  }
  for (Flight& flight : flights_) {
    if ((flight.due.empty() || !flight.known) && now - flight.last_word >= options_.ask_again) send_manifest(&flight);
  }
}

bool DepthMapSender::spare(std::size_t bytes) {
  if (budget_bytes_ < static_cast<double>(bytes) || next_flight()) return false;
  budget_bytes_ -= static_cast<double>(bytes);
  return true;
}

/// Microseconds since 1970 by a clock that is not set in between: receipts compare such stamps.
std::int64_t DepthMapSender::stamp() const {
  return stamp_offset_us_ + std::chrono::duration_cast<std::chrono::microseconds>(clock_.monotonic()).count();
}

void DepthMapSender::send_manifest(Flight* flight) {
  depth_map_manifest_t& manifest = flight->manifest;
  manifest.utime = stamp();
  manifest.oldest_map_id = manifest.map_id;
  for (std::size_t i = 0; i < spool_.size(); ++i) {
    if (spool_[i].session == manifest.session) {
      manifest.oldest_map_id = std::min(manifest.oldest_map_id, spool_[i].map_id);
    }
  }
  publish_message(bus_, channel::kDepthManifest, manifest);
  flight->last_word = clock_.monotonic();
  flight->unanswered_chunks = 0;
}

void DepthMapSender::send_chunk(std::size_t index) {
  Flight& flight = flights_[index];
  const std::vector<std::uint8_t>& bytes = spool_[index].bytes;
  const std::int32_t number = flight.due.front();
  const auto at = static_cast<std::size_t>(number);
  flight.due.pop_front();
  flight.queued[at] = false;
  const std::size_t begin = at * static_cast<std::size_t>(kChunkBytes);
  const std::size_t size = std::min(static_cast<std::size_t>(kChunkBytes), bytes.size() - begin);
  depth_map_chunk_t chunk;
  chunk.utime = stamp();
  chunk.session = flight.manifest.session;
  chunk.map_id = flight.manifest.map_id;
  chunk.index = number;
  chunk.size = static_cast<std::int32_t>(size);
  chunk.data.assign(bytes.begin() + static_cast<std::ptrdiff_t>(begin),
                    bytes.begin() + static_cast<std::ptrdiff_t>(begin + size));
  publish_message(bus_, channel::kDepthChunk, chunk);
  budget_bytes_ -= static_cast<double>(size);
  if (flight.sent_at[at] != 0) ++chunks_sent_again_;
  flight.sent_at[at] = chunk.utime;
  flight.last_word = clock_.monotonic();
  ++chunks_sent_;
}

void DepthMapSender::on_receipt(const depth_map_receipt_t& receipt) {
  const auto found = std::find_if(flights_.begin(), flights_.end(), [&](const Flight& flight) {
    return flight.manifest.session == receipt.session && flight.manifest.map_id == receipt.map_id &&
           std::memcmp(flight.manifest.digest, receipt.digest, sizeof receipt.digest) == 0;
  });
  if (found == flights_.end()) return;
  if (receipt.complete != 0) {
    const auto index = static_cast<std::size_t>(found - flights_.begin());
    flights_.erase(found);
    spool_.erase(index);
    ++acknowledged_;
    return;
  }
  found->known = true;
  for (std::size_t range = 0; range < receipt.first.size(); ++range) {
    const std::int32_t last = std::min(receipt.last[range], found->manifest.chunks - 1);
    for (std::int32_t i = std::max(receipt.first[range], 0); i <= last; ++i) {
      const auto at = static_cast<std::size_t>(i);
      if (found->queued[at] || found->sent_at[at] > receipt.heard - kReordering_us) continue;
      found->queued[at] = true;
      found->due.push_back(i);
    }
  }
}

}  // namespace vantage
