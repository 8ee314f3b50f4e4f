#include "offboard/log/message_json.h"

#include <algorithm>
#include <array>

#include "offboard/log/json_text.h"

namespace vantage {
namespace {

constexpr std::array<std::string_view, 6> kRandomIds{"boot_id", "heard_boot_id", "planner",
                                                     "robot",   "sender",        "session"};

bool is_random_id(const MessageField& field) {
  return field.kind == 'q' && std::find(kRandomIds.begin(), kRandomIds.end(), field.name) != kRandomIds.end();
}

bool left_out(const ChannelSchema& schema, std::string_view field) {
  return schema.type == "depth_map_t" && (field == "images" || field == "size");
}

void put_values(const MessageField& field, JsonText* json) {
  if (field.kind == 's') {
    for (const std::string_view text : field.strings()) json->text(text);
    return;
  }
  for (std::size_t i = 0; i < field.count; ++i) {
    if (field.kind == 'd') {
      json->number(field.number(i));
    } else if (is_random_id(field)) {
      json->text(std::to_string(field.integer(i)));
    } else {
      json->integer(field.integer(i));
    }
  }
}

}  // namespace

std::string message_json(const ChannelSchema& schema, const MessageFields& message) {
  JsonText json;
  json.begin('{');
  for (const MessageField& field : message.all()) {
    if (left_out(schema, field.name)) continue;
    json.key(field.name);
    if (field.list && field.kind == 'b') {
      json.base64(field.bytes);
    } else if (field.list) {
      json.begin('[');
      put_values(field, &json);
      json.end(']');
    } else {
      put_values(field, &json);
    }
  }
  return json.end('}').str();
}

std::string json_schema(const ChannelSchema& schema) {
  JsonText json;
  json.begin('{').key("title").text("vantage." + std::string(schema.type)).key("type").text("object");
  json.key("properties").begin('{');
  for (const MessageField& field : declared_fields(schema)) {
    if (left_out(schema, field.name)) continue;
    const char* const type = field.kind == 's' || is_random_id(field) ? "string"
                             : field.kind == 'd'                      ? "number"
                                                                      : "integer";
    json.key(field.name).begin('{');
    if (field.list && field.kind == 'b') {
      json.key("type").text("string").key("contentEncoding").text("base64");
    } else if (field.list) {
      json.key("type").text("array").key("items").begin('{').key("type").text(type).end('}');
    } else {
      json.key("type").text(type);
    }
    json.end('}');
  }
  return json.end('}').end('}').str();
}

}  // namespace vantage
