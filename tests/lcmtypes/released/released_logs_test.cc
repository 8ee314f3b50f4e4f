#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <set>

#include <gtest/gtest.h>

#include "lcmtypes/link/event_log.h"
#include "lcmtypes/link/message_bus.h"
#include "offboard/log/known_channels.h"
#include "offboard/log/log_maps.h"
#include "offboard/session/session_config.h"

namespace vantage {
namespace {

namespace fs = std::filesystem;

/// One pixel of a depth map as it was before it was packed.
struct Pixel {
  std::size_t map;
  int u, v;
  DepthState state;
  double depth_m, sigma_m;  // 0: none
};

/// What a released file holds: what went into it, never what came out.
struct Released {
  const char* file;
  std::size_t events;
  std::set<std::string> channels;
  std::vector<std::ptrdiff_t> converged;  // pixels of each depth map
  std::vector<Pixel> pixels;
};

void PrintTo(const Released& released, std::ostream* out) { *out << released.file; }

const std::vector<Pixel> kSamplePixels = {{0, 0, 0, DepthState::kConverged, 0.598900, 0.00035868},
                                          {0, 15, 10, DepthState::kEdge, 0.724811, 0.00052535},
                                          {0, 31, 23, DepthState::kConverged, 1.787563, 0.00319538},
                                          {0, 6, 0, DepthState::kInvalid, 0, 0},
                                          {1, 5, 3, DepthState::kConverged, 0.637344, 0.00040621},
                                          {1, 20, 12, DepthState::kConverged, 1.647707, 0.00271494},
                                          {1, 15, 10, DepthState::kInvalid, 0, 0}};

const Released kReleased[] = {
    {.file = "0.1.0.lcm",
     .events = 13,
     .channels = {"VANTAGE_DEPTH_CHUNK_1", "VANTAGE_DEPTH_MANIFEST_1", "VANTAGE_DEPTH_MAP_1", "VANTAGE_DEPTH_RECEIPT_1",
                  "VANTAGE_HEARTBEAT_1", "VANTAGE_MOTION_GOAL_1", "VANTAGE_ROBOT_STATE_1", "VANTAGE_SESSION_CONFIG_1"},
     .converged = {628, 633},
     .pixels = kSamplePixels},
    {.file = "0.2.0.lcm",
     .events = 16,
     .channels = {"VANTAGE_COMMAND_1", "VANTAGE_DEPTH_CHUNK_1", "VANTAGE_DEPTH_MANIFEST_2", "VANTAGE_DEPTH_MAP_1",
                  "VANTAGE_DEPTH_RECEIPT_2", "VANTAGE_HEARTBEAT_2", "VANTAGE_MOTION_GOAL_1", "VANTAGE_PREVIEW_1",
                  "VANTAGE_ROBOT_STATE_1", "VANTAGE_SESSION_CONFIG_1", "VANTAGE_STATUS_1"},
     .converged = {628, 633},
     .pixels = kSamplePixels},
};

fs::path path_of(const Released& released) { return fs::path(RELEASED_LOGS) / released.file; }

class ReleasedLogs : public testing::TestWithParam<Released> {};

TEST_P(ReleasedLogs, HoldTheChannelsOfTheirVersion) {
  std::set<std::string> channels;
  std::size_t events = 0;
  LogReader reader(path_of(GetParam()));
  for (LogEvent event; reader.next(&event); ++events) channels.insert(event.channel);
  EXPECT_EQ(channels, GetParam().channels);
  EXPECT_EQ(events, GetParam().events);
}

/// By the program's own decoder where the schema is still current, and by what is known of it where it is not.
TEST_P(ReleasedLogs, EveryEventIsRead) {
  LogReader reader(path_of(GetParam()));
  for (LogEvent event; reader.next(&event);) {
    const ChannelSchema* schema = find_channel(event.channel);
    ASSERT_NE(schema, nullptr) << event.channel << ": give its version a line in offboard/log/known_channels.cc";
    std::string why;
    EXPECT_TRUE(MessageFields::read(*schema, event.bytes, &why)) << event.number << " " << event.channel << " " << why;
  }
}

TEST_P(ReleasedLogs, DepthMapsAreReadToTheSameValues) {
  std::vector<DepthMap> maps;
  for_each_depth_map(path_of(GetParam()), [&](const DepthMap& map) { maps.push_back(map); });
  ASSERT_EQ(maps.size(), GetParam().converged.size());
  for (std::size_t i = 0; i < maps.size(); ++i) {
    const DepthMap& map = maps[i];
    EXPECT_EQ(std::count(map.state.begin(), map.state.end(), DepthState::kConverged), GetParam().converged[i]);
    const auto id = static_cast<std::int64_t>(i) + 1;
    EXPECT_EQ(map.utime, 1'700'000'000'000'000 + id);
    EXPECT_EQ(map.session, 42u);
    EXPECT_EQ(map.map_id, id);
    EXPECT_EQ(map.goal_id, 7);
    EXPECT_EQ(map.view_id, 3);
    EXPECT_EQ(map.camera.width, 32);
    EXPECT_EQ(map.camera.height, 24);
    EXPECT_EQ(map.camera.fx, 0.6 * 32);
    EXPECT_EQ(map.camera.cy, 12);
    const Eigen::Isometry3d pose =
        Eigen::Translation3d(0.1, -0.2, 0.3) * Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized());
    EXPECT_TRUE(map.T_world_camera.isApprox(pose, 1e-12));
  }
  for (const Pixel& pixel : GetParam().pixels) {
    const DepthMap& map = maps[pixel.map];
    const auto i = static_cast<std::size_t>(pixel.v * map.camera.width + pixel.u);
    EXPECT_EQ(map.state[i], pixel.state) << i;
    // depth_codec.h: 3e-5 at 1.8 m, or sigma / 16
    EXPECT_NEAR(static_cast<double>(map.depth_m[i]), pixel.depth_m, std::max(1e-4, pixel.sigma_m / 16)) << i;
    EXPECT_NEAR(static_cast<double>(map.sigma_m[i]), pixel.sigma_m, 0.033 * pixel.sigma_m) << i;
  }
}

TEST_P(ReleasedLogs, ConfigurationIsReadToTheSameValues) {
  LogReader reader(path_of(GetParam()));
  LogEvent event;
  ASSERT_TRUE(reader.next(&event));
  ASSERT_EQ(event.channel, channel::kSessionConfig);
  session_config_t message;
  DecodeCounters counters;
  ASSERT_TRUE(decode_message(event.bytes, &message, &counters));
  const SessionConfig config = parse_session_config(message.yaml, GetParam().file, ".");
  EXPECT_EQ(config.region.resolution_m, 0.01);
  EXPECT_EQ(config.region.size_voxels, Eigen::Vector3i(128, 128, 128));
  EXPECT_TRUE(config.region.min_corner.isApprox(Eigen::Vector3d(-0.64, -0.64, -0.04), 1e-12));
  EXPECT_EQ(config.sensor.hit_probability, 0.8);
  EXPECT_EQ(config.sensor.miss_probability, 0.2);
  ASSERT_TRUE(config.planning);
  EXPECT_EQ(config.planning->gain, Formulation::kCombined);
  EXPECT_EQ(config.planning->ray_columns, 80);
  EXPECT_EQ(config.planning->planner.most_views, 20);
  EXPECT_EQ(config.cloud.spacing_m, 0.002);
}

INSTANTIATE_TEST_SUITE_P(All, ReleasedLogs, testing::ValuesIn(kReleased));

TEST(ReleasedLogsFolder, TheNextOneWillHoldEveryChannel) {
  const fs::path log = fs::path(testing::TempDir()) / "next_release.lcm";
  ASSERT_EQ(std::system((WRITE_RELEASED_LOG " " + log.string()).c_str()), 0);
  std::set<std::string_view> written, current;
  LogReader reader(log);
  for (LogEvent event; reader.next(&event);) {
    const ChannelSchema* schema = find_channel(event.channel);
    ASSERT_NE(schema, nullptr) << event.channel;
    written.insert(schema->channel);
    std::string why;
    EXPECT_TRUE(MessageFields::read(*schema, event.bytes, &why)) << event.channel << " " << why;
  }
  for (const ChannelSchema& schema : known_channels()) {
    if (schema.current()) current.insert(schema.channel);
  }
  EXPECT_EQ(written, current);
}

TEST(ReleasedLogsFolder, NoFileIsForgotten) {
  std::set<std::string> here, tested;
  for (const fs::directory_entry& entry : fs::directory_iterator(RELEASED_LOGS)) {
    if (entry.path().extension() == ".lcm") here.insert(entry.path().filename().string());
  }
  for (const Released& released : kReleased) tested.insert(released.file);
  EXPECT_EQ(here, tested);
}

}  // namespace
}  // namespace vantage
