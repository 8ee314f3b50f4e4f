#include "offboard/log/mcap_writer.h"

#include <algorithm>
#include <limits>
#include <stdexcept>

#include <zstd.h>

#include "offboard/log/crc32.h"

namespace vantage {
namespace {

constexpr std::string_view kMagic{"\x89MCAP0\r\n", 8};
constexpr std::string_view kCompression = "zstd";

enum class Op : char {
  kHeader = 1,
  kFooter = 2,
  kSchema = 3,
  kChannel = 4,
  kMessage = 5,
  kChunk = 6,
  kMessageIndex = 7,
  kChunkIndex = 8,
  kStatistics = 11,
  kSummaryOffset = 14,
  kDataEnd = 15
};

/// A record's content: little-endian numbers, strings behind their 32-bit length.
class Fields {
 public:
  template <typename Integer>
  Fields& put(Integer value) {
    for (std::size_t i = 0; i < sizeof value; ++i)
      bytes_ += static_cast<char>(static_cast<std::uint64_t>(value) >> 8 * i);
    return *this;
  }
  Fields& text(std::string_view value) {
    put(static_cast<std::uint32_t>(value.size()));
    return raw(value);
  }
  Fields& raw(std::string_view value) {
    bytes_ += value;
    return *this;
  }
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

std::string record_head(Op op, std::uint64_t size) { return static_cast<char>(op) + Fields().put(size).bytes(); }

std::string record(Op op, const Fields& fields) { return record_head(op, fields.bytes().size()) + fields.bytes(); }

}  // namespace

void McapWriter::TimeSpan::add(std::uint64_t time) {
  start = std::min(start, time);
  end = std::max(end, time);
}

McapWriter::McapWriter(std::ostream& out, std::string_view library, McapWriterOptions options)
    : out_(out), options_(options) {
  put(kMagic);
  put(record(Op::kHeader, Fields().text("").text(library)));
}

void McapWriter::put(std::string_view bytes) {
  out_.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  offset_ += bytes.size();
  crc_ = crc32(bytes, crc_);
}

McapWriter::SchemaId McapWriter::add_schema(std::string_view name, std::string_view encoding, std::string_view data) {
  const SchemaId id = ++schema_count_;
  const std::string schema = record(Op::kSchema, Fields().put(id).text(name).text(encoding).text(data));
  schemas_ += schema;
  chunk_ += schema;
  return id;
}

McapWriter::ChannelId McapWriter::add_channel(SchemaId schema, std::string_view topic,
                                              std::string_view message_encoding) {
  if (channel_count_ == std::numeric_limits<ChannelId>::max())
    throw std::length_error("MCAP has 65,535 channels at most");
  const ChannelId id = channel_count_++;
  const std::string channel =
      record(Op::kChannel, Fields().put(id).put(schema).text(topic).text(message_encoding).put(std::uint32_t{0}));
  channels_ += channel;
  chunk_ += channel;
  return id;
}

void McapWriter::write(ChannelId channel, std::uint32_t sequence, std::uint64_t log_time, std::uint64_t publish_time,
                       std::span<const std::uint8_t> data) {
  chunk_index_[channel] += Fields().put(log_time).put(std::uint64_t{chunk_.size()}).bytes();
  const Fields head = Fields().put(channel).put(sequence).put(log_time).put(publish_time);
  chunk_ += record_head(Op::kMessage, head.bytes().size() + data.size());
  chunk_ += head.bytes();
  chunk_.append(reinterpret_cast<const char*>(data.data()), data.size());
  chunk_times_.add(log_time);
  times_.add(log_time);
  ++message_counts_[channel];
  ++messages_;
  if (chunk_.size() >= options_.chunk_bytes) close_chunk();
}

void McapWriter::close_chunk() {
  if (chunk_.empty()) return;
  std::string packed(ZSTD_compressBound(chunk_.size()), '\0');
  const std::size_t size =
      ZSTD_compress(packed.data(), packed.size(), chunk_.data(), chunk_.size(), options_.compression_level);
  if (ZSTD_isError(size) != 0) throw std::runtime_error(std::string("zstd: ") + ZSTD_getErrorName(size));
  packed.resize(size);
  if (chunk_index_.empty()) chunk_times_ = {0, 0};  // schemas and channels alone
  ChunkIndex index{chunk_times_.start, chunk_times_.end, offset_, 0, {}, 0, packed.size(), chunk_.size()};
  const Fields head = Fields()
                          .put(chunk_times_.start)
                          .put(chunk_times_.end)
                          .put(std::uint64_t{chunk_.size()})
                          .put(crc32(chunk_))
                          .text(kCompression)
                          .put(std::uint64_t{packed.size()});
  put(record_head(Op::kChunk, head.bytes().size() + packed.size()));
  put(head.bytes());
  put(packed);
  index.length = offset_ - index.offset;
  for (const auto& [channel, entries] : chunk_index_) {
    index.index_offsets.emplace_back(channel, offset_);
    put(record(Op::kMessageIndex, Fields().put(channel).text(entries)));
  }
  index.index_length = offset_ - index.offset - index.length;
  chunks_.push_back(std::move(index));
  chunk_.clear();
  chunk_index_.clear();
  chunk_times_ = {};
}

std::string McapWriter::statistics() const {
  Fields counts;
  for (const auto& [channel, count] : message_counts_) counts.put(channel).put(count);
  return record(Op::kStatistics, Fields()
                                     .put(messages_)
                                     .put(schema_count_)
                                     .put(std::uint32_t{channel_count_})
                                     .put(std::uint32_t{0})  // attachments
                                     .put(std::uint32_t{0})  // metadata
                                     .put(static_cast<std::uint32_t>(chunks_.size()))
                                     .put(messages_ > 0 ? times_.start : 0)
                                     .put(times_.end)
                                     .text(counts.bytes()));
}

void McapWriter::finish() {
  close_chunk();
  put(record(Op::kDataEnd, Fields().put(crc_)));
  crc_ = 0;
  const std::uint64_t summary_start = offset_;
  std::string offsets;
  const auto put_group = [&](Op op, const std::string& records) {
    if (records.empty()) return;
    offsets +=
        record(Op::kSummaryOffset, Fields().put(static_cast<char>(op)).put(offset_).put(std::uint64_t{records.size()}));
    put(records);
  };
  put_group(Op::kSchema, schemas_);
  put_group(Op::kChannel, channels_);
  put_group(Op::kStatistics, statistics());
  std::string indexes;
  for (const ChunkIndex& chunk : chunks_) {
    Fields index_offsets;
    for (const auto& [channel, offset] : chunk.index_offsets) index_offsets.put(channel).put(offset);
    indexes += record(Op::kChunkIndex, Fields()
                                           .put(chunk.start_time)
                                           .put(chunk.end_time)
                                           .put(chunk.offset)
                                           .put(chunk.length)
                                           .text(index_offsets.bytes())
                                           .put(chunk.index_length)
                                           .text(kCompression)
                                           .put(chunk.compressed_size)
                                           .put(chunk.uncompressed_size));
  }
  put_group(Op::kChunkIndex, indexes);
  const std::uint64_t offsets_start = offset_;
  put(offsets);
  put(record_head(Op::kFooter, 20) + Fields().put(summary_start).put(offsets_start).bytes());
  put(Fields().put(crc_).bytes());
  put(kMagic);
}

}  // namespace vantage
