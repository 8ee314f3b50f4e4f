#pragma once

#include <cstdint>
#include <map>
#include <ostream>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace vantage {

struct McapWriterOptions {
  std::size_t chunk_bytes = std::size_t{1}
                            << 20;  ///< of records, before compression; a chunk that grew to this is closed
  int compression_level = 3;        ///< of zstd
};

/// Writes an MCAP file (https://mcap.dev/spec): messages in chunks compressed by zstd, each with its CRC and an index
/// of its messages by channel; a summary with schemas, channels, statistics, chunk indexes and its own offsets; CRCs of
/// the data section and of the summary.
///
///     McapWriter mcap(stream, "vantage");
///     const auto schema = mcap.add_schema("vantage.heartbeat_t", "jsonschema", text);
///     const auto channel = mcap.add_channel(schema, "HEARTBEAT", "json");
///     mcap.write(channel, 0, time_ns, time_ns, bytes);
///     mcap.finish();
class McapWriter {
 public:
  using SchemaId = std::uint16_t;  ///< 0: none
  using ChannelId = std::uint16_t;

  McapWriter(std::ostream& out, std::string_view library, McapWriterOptions options = {});

  SchemaId add_schema(std::string_view name, std::string_view encoding, std::string_view data);
  ChannelId add_channel(SchemaId schema, std::string_view topic, std::string_view message_encoding);
  /// Times in ns since 1970.
  void write(ChannelId channel, std::uint32_t sequence, std::uint64_t log_time, std::uint64_t publish_time,
             std::span<const std::uint8_t> data);
  /// Closes the last chunk and writes the summary. Nothing may be written after it.
  void finish();

  std::uint64_t messages() const { return messages_; }
  std::size_t chunks() const { return chunks_.size(); }

 private:
  struct ChunkIndex {
    std::uint64_t start_time, end_time, offset, length;
    std::vector<std::pair<ChannelId, std::uint64_t>> index_offsets;
    std::uint64_t index_length, compressed_size, uncompressed_size;
  };
  struct TimeSpan {
    std::uint64_t start = UINT64_MAX, end = 0;
    void add(std::uint64_t time);
  };

  void put(std::string_view bytes);
  void close_chunk();
  std::string statistics() const;

  std::ostream& out_;
  McapWriterOptions options_;
  std::uint64_t offset_ = 0;  // in the file
  std::uint32_t crc_ = 0;     // of the section so far
  std::string chunk_;         // records of the open chunk
  TimeSpan chunk_times_, times_;
  std::map<ChannelId, std::string> chunk_index_;  // entries of (time, offset in the chunk)
  std::string schemas_, channels_;                // records, for the summary
  std::uint16_t schema_count_ = 0, channel_count_ = 0;
  std::map<ChannelId, std::uint64_t> message_counts_;
  std::uint64_t messages_ = 0;
  std::vector<ChunkIndex> chunks_;
};

}  // namespace vantage
