#include "offboard/session/session.h"

#include <filesystem>
#include <fstream>
#include <sstream>

#include <gtest/gtest.h>

#include "calib/files/ply.h"
#include "lcmtypes/link/depth_codec.h"
#include "lcmtypes/link/depth_map_receiver.h"
#include "lcmtypes/link/depth_map_sender.h"
#include "lcmtypes/link/memory_bus.h"
#include "lcmtypes/link/pose_fields.h"
#include "lcmtypes/link/sealed_bus.h"
#include "offboard/mapping/octomap_io.h"
#include "offboard/replay.h"
#include "tests/input_fault.h"
#include "tests/lcmtypes/sample_depth_map.h"

namespace vantage {
namespace {

namespace fs = std::filesystem;

std::string text_of(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

class SessionTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(testing::TempDir()) / testing::UnitTest::GetInstance()->current_test_info()->name();
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    config_.region = Region::cube({0, 0, 0.6}, 1.28, 0.04);
    config_.planning->ray_columns = 16;
    config_.planning->ray_rows = 12;
    config_.planning->planner.most_views = 3;
  }

  /// A map as a camera at the session's goal would give it: everything 0.5 m away.
  depth_map_t answer(const Session& session, std::int64_t id) {
    DepthMap map = sample_depth_map(64, 48, 1);
    map.map_id = id;
    map.view_id = session.goal()->id;
    map.T_world_camera = session.goal()->T_world_camera;
    map.depth_m.assign(map.depth_m.size(), 0.5F);
    map.sigma_m.assign(map.sigma_m.size(), 0.002F);
    map.state.assign(map.state.size(), DepthState::kConverged);
    return pack_depth_map(map);
  }

  /// A map with that id, from anywhere.
  static depth_map_t answer_at(std::int64_t id) {
    DepthMap map = sample_depth_map(64, 48, 1);
    map.map_id = id;
    return pack_depth_map(map);
  }

  /// A live session of three views, and the same from its log.
  void run_and_replay();

  void run(Session& session) {
    std::string why;
    for (std::int64_t id = 1; !session.finished(); ++id) ASSERT_TRUE(session.take(answer(session, id), &why)) << why;
    session.write_results();
  }

  fs::path folder_;
  SessionConfig config_;
  SystemClock clock_;
  std::ostringstream terminal_;
  std::atomic<bool> never_ = false;
};

void SessionTest::run_and_replay() {
  write_ply(folder_ / "surface.ply", {{{0, 0, 0.1F}, {0.1F, 0, 0.2F}}, {}, {}});
  std::ofstream(folder_ / "candidates.txt") << "0.6 0 0.2 -0.5 -0.5 0.5 0.5\n0 0.6 0.2 0 -0.7071068 0.7071068 0\n"
                                               "0.6 0 0.4 -0.5 -0.5 0.5 0.5\n-0.6 0 0.3 0.5 -0.5 0.5 -0.5\n";
  config_.truth = folder_ / "surface.ply";
  config_.planning->views = folder_ / "candidates.txt";
  {
    Session session(config_, folder_ / "live", false, clock_, terminal_);
    run(session);
    EXPECT_EQ(session.steps(), 3);
  }
  fs::remove(folder_ / "surface.ply");  // the session has its own copies
  fs::remove(folder_ / "candidates.txt");
  const LogContents contents = examine_log(folder_ / "live" / "log.lcm");
  ASSERT_TRUE(contents.config);
  EXPECT_EQ(contents.depth_maps, 3);
  Session again(*contents.config, folder_ / "again", false, clock_, terminal_);
  replay_log(folder_ / "live" / "log.lcm", 0, never_, again);
  again.write_results();
  for (const char* file : {"config.yaml", "steps.csv", "scores.csv", "map.ot", "mesh.ply", "cloud.ply", "view.html",
                           "truth.ply", "views.txt"}) {
    EXPECT_EQ(text_of(folder_ / "live" / file), text_of(folder_ / "again" / file)) << file;
    EXPECT_FALSE(text_of(folder_ / "live" / file).empty()) << file;
  }
  EXPECT_TRUE(read_map(folder_ / "live" / "map.ot") == again.map());
}

TEST_F(SessionTest, AReplayGivesTheSameFilesToTheByte) { run_and_replay(); }

TEST_F(SessionTest, AReplayOfAViewSetGivesTheSameFilesToTheByte) {
  config_.planning->method = PlanningMethod::kViewSet;
  run_and_replay();
  EXPECT_NE(text_of(folder_ / "live" / "steps.csv").find("begins the best tour of"), std::string::npos)
      << text_of(folder_ / "live" / "steps.csv");
}

key_pose_t key_pose(const depth_map_t& map, const Eigen::Isometry3d& T_world_camera) {
  key_pose_t message;
  message.utime = 1;
  message.session = map.session;
  message.map_id = map.map_id;
  set_pose(T_world_camera, &message);
  return message;
}

TEST_F(SessionTest, ACorrectedKeyFrameMakesTheMapAsIfItHadStoodThereAtOnce) {
  config_.planning.reset();
  std::string why;
  std::vector<depth_map_t> maps;
  for (int i = 0; i < 3; ++i) {
    DepthMap map = sample_depth_map(64, 48, 1);
    map.map_id = i + 1;
    map.T_world_camera = Eigen::Translation3d(0.1 * i, 0, 0) * Eigen::Isometry3d::Identity();
    map.depth_m.assign(map.depth_m.size(), 0.5F);
    map.sigma_m.assign(map.sigma_m.size(), 0.002F);
    map.state.assign(map.state.size(), DepthState::kConverged);
    maps.push_back(pack_depth_map(map));
  }
  Session corrected(config_, folder_ / "corrected", false, clock_, terminal_);
  for (const depth_map_t& map : maps) ASSERT_TRUE(corrected.take(map, &why)) << why;
  const OccupancyMap before = corrected.map();
  const Eigen::Isometry3d moved(Eigen::Translation3d(0.1, 0.05, 0.12));
  EXPECT_TRUE(corrected.correct(key_pose(maps[1], moved)));
  EXPECT_FALSE(corrected.correct(key_pose(maps[1], moved)));  // it is told again and again
  depth_map_t unknown = maps[1];
  unknown.map_id = 9;
  EXPECT_FALSE(corrected.correct(key_pose(unknown, moved)));
  unknown = maps[1];
  unknown.session += 1;
  EXPECT_FALSE(corrected.correct(key_pose(unknown, moved)));
  key_pose_t bad = key_pose(maps[1], moved);
  bad.position[0] = std::nan("");
  EXPECT_FALSE(corrected.correct(bad));
  corrected.write_results();
  EXPECT_FALSE(corrected.map() == before);

  set_pose(moved, &maps[1]);
  Session direct(config_, folder_ / "direct", false, clock_, terminal_);
  for (const depth_map_t& map : maps) ASSERT_TRUE(direct.take(map, &why)) << why;
  direct.write_results();
  EXPECT_TRUE(corrected.map() == direct.map());
  for (const char* file : {"map.ot", "mesh.ply", "cloud.ply"}) {
    EXPECT_EQ(text_of(folder_ / "corrected" / file), text_of(folder_ / "direct" / file)) << file;
  }
}

TEST_F(SessionTest, CorrectionsComeBackInReplayAndResume) {
  config_.planning->planner.most_views = 4;
  const Eigen::Isometry3d shift(Eigen::Translation3d(0.03, -0.05, 0.02));
  const auto take = [&](Session& session, std::int64_t id) {
    std::string why;
    const depth_map_t map = answer(session, id);
    EXPECT_TRUE(session.take(map, &why)) << why;
    return map;
  };
  {
    Session session(config_, folder_ / "live", false, clock_, terminal_);
    const depth_map_t first = take(session, 1);
    take(session, 2);
    EXPECT_TRUE(session.correct(key_pose(first, *pose_of(first) * shift)));
    const depth_map_t third = take(session, 3);
    EXPECT_TRUE(session.correct(key_pose(third, *pose_of(third) * shift)));  // nothing follows it before the resume
  }
  std::unique_ptr<Session> resumed = Session::resume(folder_ / "live", clock_, terminal_);
  take(*resumed, 4);
  ASSERT_TRUE(resumed->finished());
  EXPECT_FALSE(resumed->correct(key_pose(answer_at(1), shift)));  // too late
  resumed->write_results();

  Session again(config_, folder_ / "again", false, clock_, terminal_);
  replay_log(folder_ / "live" / "log.lcm", 0, never_, again);
  again.write_results();
  for (const char* file : {"steps.csv", "scores.csv", "map.ot", "mesh.ply", "cloud.ply", "view.html"}) {
    EXPECT_EQ(text_of(folder_ / "live" / file), text_of(folder_ / "again" / file)) << file;
  }
}

TEST_F(SessionTest, StepsTableHasALineAView) {
  Session session(config_, folder_ / "s", false, clock_, terminal_);
  run(session);
  std::istringstream table(text_of(folder_ / "s" / "steps.csv"));
  std::string line;
  std::getline(table, line);
  const auto columns = std::count(line.begin(), line.end(), ',');
  int lines = 0;
  for (; std::getline(table, line); ++lines) EXPECT_EQ(std::count(line.begin(), line.end(), ','), columns) << line;
  EXPECT_EQ(lines, 3);
  EXPECT_NE(terminal_.str().find("view 3 of 3"), std::string::npos);
}

TEST_F(SessionTest, ARefusedMapLeavesLogAndTablesAlone) {
  Session session(config_, folder_ / "s", false, clock_, terminal_);
  depth_map_t bad = answer(session, 1);
  bad.position[0] = std::nan("");
  const auto log_before = fs::file_size(folder_ / "s" / "log.lcm");
  std::string why;
  EXPECT_FALSE(session.take(bad, &why));
  EXPECT_NE(why.find("pose"), std::string::npos);
  EXPECT_EQ(fs::file_size(folder_ / "s" / "log.lcm"), log_before);
  EXPECT_EQ(session.steps(), 0);
}

TEST_F(SessionTest, BadInputsLeaveNoFolder) {
  const auto start = [&] { Session session(config_, folder_ / "s", false, clock_, terminal_); };
  config_.truth = folder_ / "none.ply";
  EXPECT_NE(input_fault(start).find("none.ply"), std::string::npos);
  config_.truth.clear();
  config_.planning->views = folder_ / "none.txt";
  EXPECT_NE(input_fault(start).find("none.txt"), std::string::npos);
  EXPECT_FALSE(fs::exists(folder_ / "s"));
}

TEST_F(SessionTest, AnEarlierSessionIsKeptUnlessOverwritten) {
  { Session session(config_, folder_ / "s", false, clock_, terminal_); }
  std::ofstream(folder_ / "s" / "notes.txt") << "mine";
  EXPECT_NE(input_fault([&] { Session session(config_, folder_ / "s", false, clock_, terminal_); }).find("--overwrite"),
            std::string::npos);
  EXPECT_EQ(input_fault([&] { Session session(config_, folder_ / "s", true, clock_, terminal_); }), "");
  EXPECT_EQ(text_of(folder_ / "s" / "notes.txt"), "mine");
}

TEST_F(SessionTest, ADamagedLogIsNamedWithItsEvent) {
  {
    Session session(config_, folder_ / "s", false, clock_, terminal_);
    run(session);
  }
  const fs::path log = folder_ / "bad.lcm";
  const auto with_event = [&](const char* name, const std::vector<std::uint8_t>& bytes) {
    LogWriter writer(log);
    writer.write(1, "SOMEONE_ELSES", std::vector<std::uint8_t>{1, 2, 3});
    writer.write(2, name, bytes);
  };
  with_event(channel::kDepthMap, {1, 2, 3, 4, 5, 6, 7, 8, 9});
  EXPECT_NE(input_fault([&] { examine_log(log); }).find("bad.lcm: event 1 (VANTAGE_DEPTH_MAP_1): is of another type"),
            std::string::npos);
  depth_map_t nan_pose = pack_depth_map(sample_depth_map());
  nan_pose.position[2] = std::nan("");
  with_event(channel::kDepthMap, encode_message(nan_pose));
  EXPECT_NE(input_fault([&] { examine_log(log); }).find("the pose T_world_camera is not finite"), std::string::npos);
  session_config_t config{};
  config.yaml = "config_version: 1\nregoin: {}\n";
  with_event(channel::kSessionConfig, encode_message(config));
  EXPECT_NE(input_fault([&] { examine_log(log); }).find("regoin: unknown key"), std::string::npos);
}

TEST(SessionConfig, IsReadBackToTheBit) {
  SessionConfig config;
  config.region.min_corner = {-0.1, 1.0 / 3, 7};
  config.region.size_voxels = {10, 20, 1024};
  config.region.resolution_m = 0.0025;
  config.sensor.hit_probability = 0.71;
  config.sensor.max_range_m = 4.2;
  config.planning->gain = Formulation::kProximityCount;
  config.planning->views = "views.txt";
  config.planning->planner = {.first_view = 7,
                              .most_views = 11,
                              .enough = {.gain = 0.125, .share = 0.25},
                              .most_seconds = 60,
                              .most_way_m = 4.5};
  config.truth = "truth.ply";
  config.coverage_distance_m = 0.01;
  const std::string text = to_yaml(config);
  const SessionConfig again = parse_session_config(text, "text", "");
  EXPECT_EQ(to_yaml(again), text);
  EXPECT_TRUE(again.region == config.region);
  EXPECT_TRUE(again.sensor == config.sensor);
  EXPECT_EQ(again.planning->method, config.planning->method);
  EXPECT_EQ(again.planning->gain, config.planning->gain);
  config.planning->method = PlanningMethod::kViewSet;
  config.planning->ground_m = 0.7;
  const SessionConfig of_view_set = parse_session_config(to_yaml(config), "text", "");
  EXPECT_EQ(of_view_set.planning->method, PlanningMethod::kViewSet);
  EXPECT_EQ(of_view_set.planning->ground_m, 0.7);
  config.planning.reset();
  EXPECT_FALSE(parse_session_config(to_yaml(config), "text", "").planning);
}

TEST(SessionConfig, FaultsNameLineAndKey) {
  const auto message = [](const std::string& text) {
    return input_fault([&] { parse_session_config("config_version: 1\n" + text, "c.yaml", ""); });
  };
  EXPECT_EQ(message("plan: true\n"), "");
  EXPECT_NE(message("sensor:\n  hit: 0.1\n").find("c.yaml:3: sensor.hit:"), std::string::npos);
  EXPECT_NE(message("region:\n  resolution: 1 cm\n  min: [0 m, 0 m, 0 m]\n  size: [1 mm, 1 m, 1 m]\n").find("c.yaml:5"),
            std::string::npos);
  EXPECT_NE(message("planning:\n  gain: most\n").find("occlusion_aware"), std::string::npos);
  EXPECT_NE(message("planning:\n  method: guess\n").find("view_set"), std::string::npos);
  EXPECT_NE(message("planning:\n  method: view_set\n  gain: entropy\n").find("gain: is of"), std::string::npos);
  EXPECT_NE(message("plan: false\nplanning:\n  gain: entropy\n").find("contradicts"), std::string::npos);
  EXPECT_NE(message("planning:\n  rays: [0, 60]\n").find("rays"), std::string::npos);
}

TEST_F(SessionTest, ARecordingOfASealedNetworkIsReplayed) {
  // What lcm-logger would have heard: manifests with their seals, chunks, and all the rest.
  MemoryBus wire;
  SealedBus bus(wire, {make_link_key()});
  ManualClock time;
  const fs::path log = folder_ / "heard.lcm";
  LogWriter writer(log);
  for (const char* name : {channel::kDepthManifest, channel::kDepthChunk, channel::kDepthReceipt}) {
    wire.subscribe(name, [&writer, name](std::span<const std::uint8_t> bytes) { writer.write(1, name, bytes); });
  }
  std::vector<depth_map_t> heard;
  DepthMapReceiver receiver(bus, time, [&heard](const depth_map_t& map) { heard.push_back(map); });
  DepthMapSender sender(bus, time);
  config_.planning.reset();
  for (unsigned i = 1; i <= 3; ++i) sender.enqueue(pack_depth_map(sample_depth_map(64, 48, i)));
  for (int t = 0; t < 1000 && !sender.idle(); ++t) {
    time.advance(std::chrono::milliseconds(1));
    sender.step();
    while (wire.handle(std::chrono::milliseconds(0))) {
    }
  }
  ASSERT_EQ(heard.size(), 3u);
  examine_log(log);
  Session session(config_, folder_ / "s", false, clock_, terminal_);
  replay_log(log, 0, never_, session);
  EXPECT_EQ(session.steps(), 3);
}

TEST_F(SessionTest, AResumedSessionEqualsOneThatWasNeverKilled) {
  // Its log cut at every kind of place: within the first event, between events, within a depth map.
  config_.planning->planner.most_views = 3;
  {
    Session session(config_, folder_ / "whole", false, clock_, terminal_);
    run(session);
  }
  const auto size = fs::file_size(folder_ / "whole" / "log.lcm");
  for (const double share : {0.0, 0.001, 0.3, 0.5, 0.8, 0.999, 1.0}) {
    SCOPED_TRACE(share);
    const fs::path killed = folder_ / ("killed_" + std::to_string(share));
    fs::copy(folder_ / "whole", killed);
    for (const char* file : {"map.ot", "mesh.ply", "cloud.ply", "view.html"}) fs::remove(killed / file);
    fs::resize_file(killed / "log.lcm", static_cast<std::uintmax_t>(static_cast<double>(size) * share));
    fs::resize_file(killed / "steps.csv", fs::file_size(killed / "steps.csv") / 2);
    {
      const std::unique_ptr<Session> session = Session::resume(killed, clock_, terminal_);
      std::string why;
      while (!session->finished()) {
        ASSERT_TRUE(session->take(answer(*session, session->steps() + 1), &why)) << why;
      }
      session->write_results();
    }
    for (const char* file : {"steps.csv", "scores.csv", "map.ot", "mesh.ply", "cloud.ply", "view.html"}) {
      EXPECT_EQ(text_of(folder_ / "whole" / file), text_of(killed / file)) << file;
    }
    const LogContents contents = examine_log(killed / "log.lcm");  // whole again
    EXPECT_EQ(contents.depth_maps, 3);
    EXPECT_TRUE(contents.config);
  }
}

TEST_F(SessionTest, WhatIsNoSessionCannotBeResumed) {
  EXPECT_NE(input_fault([&] { Session::resume(folder_ / "none", clock_, terminal_); }).find("no session to resume"),
            std::string::npos);
}

}  // namespace
}  // namespace vantage
