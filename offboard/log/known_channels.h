#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace vantage {

/// One version of a message type, and the channel that carries it.
struct ChannelSchema {
  std::string_view channel;
  std::string_view type;
  std::string_view fields;  ///< in the .lcm file's order and form: "utime size data[size]"
  std::string_view layout;  ///< wire_layout.h
  std::uint64_t fingerprint = 0;
  bool (*decodes)(std::span<const std::uint8_t> bytes) = nullptr;  ///< none for a version of an earlier release

  bool current() const { return decodes != nullptr; }
};

/// Every channel of ours, of this version and of those before. A new channel, or a new version of one, is a line there;
/// the old version's line stays, so that old logs stay readable.
std::span<const ChannelSchema> known_channels();
/// Nothing for a channel of another project, or of a version to come.
const ChannelSchema* find_channel(std::string_view channel);

/// One field of a message, as the wire has it.
struct MessageField {
  std::string_view name;
  char kind = 0;            ///< q i b integers of 64, 32, 8 bits; d double; s string
  bool list = false;        ///< an array; else `count` is 1
  std::string_view length;  ///< the field that tells how long the array is; empty: always `count`
  std::size_t count = 0;
  std::span<const std::uint8_t> bytes;  ///< of all elements

  std::int64_t integer(std::size_t i = 0) const;  ///< \pre kind is q, i or b
  double number(std::size_t i = 0) const;         ///< \pre kind is d
  std::vector<std::string_view> strings() const;  ///< \pre kind is s
};

/// A schema's fields, without values.
std::vector<MessageField> declared_fields(const ChannelSchema& schema);

/// A message taken apart; the spans point into the bytes given.
class MessageFields {
 public:
  /// Checks fingerprint and length. A message recorded from the network may carry its seal behind it (sealed_bus.h):
  /// without the key it can't be checked, and is passed over.
  /// Nothing, with the reason in `why`, when the bytes are no such message.
  static std::optional<MessageFields> read(const ChannelSchema& schema, std::span<const std::uint8_t> bytes,
                                           std::string* why);

  const std::vector<MessageField>& all() const { return fields_; }
  /// None when the schema has no such field.
  const MessageField* find(std::string_view name) const;
  /// The message without its seal.
  std::span<const std::uint8_t> body() const { return body_; }

 private:
  std::vector<MessageField> fields_;
  std::span<const std::uint8_t> body_;
};

}  // namespace vantage
