#include "offboard/log/known_channels.h"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>

#include "lcmtypes/link/message_bus.h"
#include "lcmtypes/link/sealed_bus.h"

namespace vantage {
namespace {

constexpr std::size_t kFingerprintBytes = 8;

template <typename Message>
bool decodes(std::span<const std::uint8_t> bytes) {
  Message message;
  DecodeCounters counters;
  return decode_message(bytes, &message, &counters);
}

template <typename Message>
ChannelSchema current(std::string_view channel, std::string_view fields) {
  return {channel,
          Message::getTypeName(),
          fields,
          kWireLayout<Message>,
          static_cast<std::uint64_t>(Message::getHash()),
          &decodes<Message>};
}

std::uint64_t big_endian(std::span<const std::uint8_t> bytes) {
  std::uint64_t value = 0;
  for (const std::uint8_t byte : bytes) value = value << 8 | byte;
  return value;
}

std::size_t element_bytes(char kind) { return kind == 'q' || kind == 'd' ? 8 : kind == 'i' ? 4 : 1; }

/// The layout's codes one by one ("2d" is two), arrays in capital letters without their index.
std::string flatten(std::string_view layout) {
  std::string codes;
  std::size_t repeat = 0;
  for (std::size_t i = 0; i < layout.size(); ++i) {
    const char code = layout[i];
    if (code >= '0' && code <= '9') {
      repeat = 10 * repeat + static_cast<std::size_t>(code - '0');
    } else if (code != ' ') {
      codes.append(std::max<std::size_t>(repeat, 1), code);
      repeat = 0;
      if (code >= 'A' && code <= 'Z') ++i;
    }
  }
  return codes;
}

/// How many bytes so many strings take, each a length and as many bytes.
std::size_t string_bytes(std::span<const std::uint8_t> bytes, std::size_t count) {
  std::size_t size = 0;
  for (; count > 0; --count) size += 4 + static_cast<std::size_t>(big_endian(bytes.subspan(size, 4)));
  return size;
}

}  // namespace

std::span<const ChannelSchema> known_channels() {
  static const std::vector<ChannelSchema> channels{
      current<depth_map_t>(channel::kDepthMap,
                           "utime session map_id goal_id view_id width height focal_length[2] principal_point[2] "
                           "position[3] quaternion_xyzw[4] inverse_depth_range[2] size images[size]"),
      current<depth_map_manifest_t>(channel::kDepthManifest,
                                    "utime session map_id oldest_map_id bytes chunk_bytes chunks digest[32]"),
      current<depth_map_chunk_t>(channel::kDepthChunk, "utime session map_id index size data[size]"),
      current<depth_map_receipt_t>(channel::kDepthReceipt,
                                   "utime session map_id heard complete digest[32] ranges first[ranges] last[ranges]"),
      current<command_t>(channel::kCommand, "utime sender robot counter expires kind size payload[size]"),
      current<motion_goal_t>(channel::kMotionGoal, "utime planner goal_id view_id position[3] quaternion_xyzw[4]"),
      current<robot_state_t>(channel::kRobotState,
                             "utime session planner goal_id activity position[3] quaternion_xyzw[4]"),
      current<heartbeat_t>(channel::kHeartbeat,
                           "utime boot_id link_version role phase heard_boot_id heard_sent heard_at command_counter "
                           "version message"),
      current<status_t>(channel::kStatus, "utime boot_id role uptime counters name[counters] value[counters]"),
      current<key_pose_t>(channel::kKeyPose, "utime session map_id position[3] quaternion_xyzw[4]"),
      current<preview_t>(channel::kPreview, "utime session width height size jpeg[size]"),
      current<session_config_t>(channel::kSessionConfig, "utime yaml"),
      // 0.1.0
      {"VANTAGE_DEPTH_MANIFEST_1", "depth_map_manifest_t", "utime session map_id bytes chunk_bytes chunks digest[32]",
       "3q 3i 32b", 0x157eaac886f2b2b9},
      {"VANTAGE_DEPTH_RECEIPT_1", "depth_map_receipt_t",
       "utime session map_id complete digest[32] ranges first[ranges] last[ranges]", "3q b 32b n I0 I0",
       0x0608fdda5087c5d6},
      {"VANTAGE_HEARTBEAT_1", "heartbeat_t", "utime boot_id role phase version message", "2q 2b s s",
       0x2cf5d884a5678ba9},
  };
  return channels;
}

const ChannelSchema* find_channel(std::string_view channel) {
  const std::span<const ChannelSchema> all = known_channels();
  const auto found = std::find_if(all.begin(), all.end(), [&](const ChannelSchema& s) { return s.channel == channel; });
  return found == all.end() ? nullptr : &*found;
}

std::vector<MessageField> declared_fields(const ChannelSchema& schema) {
  const std::string codes = flatten(schema.layout);
  std::size_t at = 0;
  std::vector<MessageField> fields;
  for (std::string_view names = schema.fields; !names.empty();) {
    const std::string_view declaration = names.substr(0, names.find(' '));
    names.remove_prefix(std::min(names.size(), declaration.size() + 1));
    const std::size_t bracket = declaration.find('[');
    MessageField field;
    field.name = declaration.substr(0, bracket);
    field.list = bracket != std::string_view::npos;
    field.count = 1;
    const char code = codes.at(at);
    if (code >= 'A' && code <= 'Z') {
      field.kind = code == 'B' ? 'b' : code == 'I' ? 'i' : code == 'Q' ? 'q' : 's';
      field.length = declaration.substr(bracket + 1, declaration.size() - bracket - 2);
    } else {
      field.kind = code == 'n' ? 'i' : code;
      if (field.list) std::from_chars(declaration.data() + bracket + 1, declaration.end(), field.count);
    }
    at += field.count;
    fields.push_back(field);
  }
  return fields;
}

std::int64_t MessageField::integer(std::size_t i) const {
  const std::size_t size = element_bytes(kind);
  const std::uint64_t value = big_endian(bytes.subspan(i * size, size));
  if (size == 8) return static_cast<std::int64_t>(value);
  if (size == 4) return static_cast<std::int32_t>(value);
  return static_cast<std::int8_t>(value);
}

double MessageField::number(std::size_t i) const { return std::bit_cast<double>(big_endian(bytes.subspan(8 * i, 8))); }

std::vector<std::string_view> MessageField::strings() const {
  std::vector<std::string_view> all;
  for (std::size_t at = 0; all.size() < count;) {
    const std::uint64_t size = big_endian(bytes.subspan(at, 4));
    all.emplace_back(reinterpret_cast<const char*>(bytes.data()) + at + 4, size - 1);  // without its NUL
    at += 4 + size;
  }
  return all;
}

std::optional<MessageFields> MessageFields::read(const ChannelSchema& schema, std::span<const std::uint8_t> bytes,
                                                 std::string* why) {
  if (bytes.size() < kFingerprintBytes || big_endian(bytes.first(kFingerprintBytes)) != schema.fingerprint) {
    *why = "is of another type or version than its channel says";
    return std::nullopt;
  }
  MessageFields message;
  message.body_ = without_seal(schema.layout, bytes);
  if (!layout_fits(schema.layout, message.body_)) {
    *why = "is not as long as its content says";
    return std::nullopt;
  }
  if (schema.decodes != nullptr && !schema.decodes(message.body_)) {
    *why = "does not decode";
    return std::nullopt;
  }
  std::span<const std::uint8_t> rest = message.body_.subspan(kFingerprintBytes);
  for (MessageField field : declared_fields(schema)) {
    if (!field.length.empty()) field.count = static_cast<std::size_t>(message.find(field.length)->integer());
    field.bytes =
        rest.first(field.kind == 's' ? string_bytes(rest, field.count) : field.count * element_bytes(field.kind));
    rest = rest.subspan(field.bytes.size());
    message.fields_.push_back(field);
  }
  return message;
}

const MessageField* MessageFields::find(std::string_view name) const {
  const auto found =
      std::find_if(fields_.begin(), fields_.end(), [&](const MessageField& field) { return field.name == name; });
  return found == fields_.end() ? nullptr : &*found;
}

}  // namespace vantage
