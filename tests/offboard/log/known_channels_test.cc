#include "offboard/log/known_channels.h"

#include <fstream>
#include <iterator>
#include <set>
#include <sstream>

#include <gtest/gtest.h>

#include "offboard/log/message_json.h"
#include "tests/offboard/log/sample_log.h"

namespace vantage {
namespace {

std::string text_of(const std::string& file) {
  std::ifstream in(std::string(VANTAGE_SOURCE_DIR) + "/" + file);
  EXPECT_TRUE(in) << file;
  return {std::istreambuf_iterator<char>(in), {}};
}

TEST(KnownChannels, CurrentOnesHaveTheFieldsOfTheirFiles) {
  for (const ChannelSchema& schema : known_channels()) {
    if (!schema.current()) continue;
    std::string fields;
    std::istringstream lines(text_of("lcmtypes/" + std::string(schema.type) + ".lcm"));
    for (std::string line; std::getline(lines, line);) {  // "  TYPE NAME;" or "  TYPE NAME[LENGTH];", then a comment
      std::istringstream words(line);
      std::string type, name;
      if (!line.starts_with("  ") || !(words >> type >> name) || type.starts_with("//") || !name.ends_with(";"))
        continue;
      fields += (fields.empty() ? "" : " ") + name.substr(0, name.size() - 1);
    }
    EXPECT_EQ(fields, schema.fields) << schema.type;
  }
}

TEST(KnownChannels, EveryChannelOfTheLinkIsKnown) {
  const std::string text = text_of("lcmtypes/link/message_bus.h");
  std::set<std::string> named, known;
  const std::string begin = "\"VANTAGE_";
  for (std::size_t at = text.find(begin); at != std::string::npos; at = text.find(begin, at + 1)) {
    named.insert(text.substr(at + 1, text.find('"', at + 1) - at - 1));
  }
  for (const ChannelSchema& schema : known_channels()) {
    if (schema.current()) known.emplace(schema.channel);
  }
  EXPECT_EQ(named, known);
}

TEST(KnownChannels, FieldsAreReadAsTheyWereWritten) {
  robot_state_t state{};
  state.session = -2;
  state.activity = -1;
  state.position[1] = 0.25;
  const std::vector<std::uint8_t> bytes = encode_message(state);
  std::string why;
  const auto fields = MessageFields::read(*find_channel(channel::kRobotState), bytes, &why);
  ASSERT_TRUE(fields) << why;
  EXPECT_EQ(fields->find("session")->integer(), -2);
  EXPECT_EQ(fields->find("activity")->integer(), -1);
  EXPECT_EQ(fields->find("position")->number(1), 0.25);
  EXPECT_EQ(fields->find("quaternion_xyzw")->count, 4u);
  EXPECT_EQ(fields->find("nothing"), nullptr);
}

TEST(KnownChannels, ASealBehindAMessageIsPassedOverAnythingElseRefused) {
  const ChannelSchema& schema = *find_channel(channel::kSessionConfig);
  session_config_t config;
  config.yaml = "a: 1";
  std::vector<std::uint8_t> bytes = encode_message(config);
  const std::size_t size = bytes.size();
  std::string why;
  for (std::size_t extra = 0; extra < 40; ++extra) {
    bytes.resize(size + extra);
    const auto fields = MessageFields::read(schema, bytes, &why);
    EXPECT_EQ(fields.has_value(), extra == 0 || extra == 32) << extra;
    if (fields) {
      EXPECT_EQ(fields->body().size(), size);
      EXPECT_EQ(fields->find("yaml")->strings(), std::vector<std::string_view>{"a: 1"});
    }
  }
  bytes.resize(size);
  bytes[0] ^= 1;
  EXPECT_FALSE(MessageFields::read(schema, bytes, &why));
  EXPECT_EQ(why, "is of another type or version than its channel says");
}

TEST(MessageJson, HasTheFilesNamesAndLosesNoDigit) {
  robot_state_t state{};
  state.utime = 5;
  state.session = kSampleSession;
  state.position[0] = 0.1;
  state.position[2] = std::nan("");
  std::string why;
  const ChannelSchema& schema = *find_channel(channel::kRobotState);
  const std::vector<std::uint8_t> bytes = encode_message(state);
  EXPECT_EQ(message_json(schema, *MessageFields::read(schema, bytes, &why)),
            R"({"utime":5,"session":"4611686018427387905","planner":"0","goal_id":0,"activity":0,)"
            R"("position":[0.1,0,null],"quaternion_xyzw":[0,0,0,0]})");
}

TEST(MessageJson, ListsStringsAndBytes) {
  status_t status{};
  status.counters = 2;
  status.name = {"a", "b\"\n"};
  status.value = {1, -2};
  const ChannelSchema& schema = *find_channel(channel::kStatus);
  std::string why;
  const std::vector<std::uint8_t> bytes = encode_message(status);
  const std::string json = message_json(schema, *MessageFields::read(schema, bytes, &why));
  EXPECT_NE(json.find(R"("counters":2,"name":["a","b\"\u000a"],"value":[1,-2])"), std::string::npos) << json;
  depth_map_chunk_t chunk{};
  chunk.size = 2;
  chunk.data = {0xff, 0x00};
  const ChannelSchema& chunk_schema = *find_channel(channel::kDepthChunk);
  const std::vector<std::uint8_t> chunk_bytes = encode_message(chunk);
  const std::string chunk_json = message_json(chunk_schema, *MessageFields::read(chunk_schema, chunk_bytes, &why));
  EXPECT_NE(chunk_json.find(R"("data":"/wA=")"), std::string::npos) << chunk_json;
}

}  // namespace
}  // namespace vantage
