#include "offboard/log/log_check.h"

#include <fstream>
#include <random>
#include <sstream>

#include "offboard/log/cloud_export.h"
#include "offboard/log/log_cut.h"
#include "offboard/log/log_info.h"
#include "offboard/log/mcap_export.h"
#include "tests/input_fault.h"
#include "tests/offboard/log/log_folder.h"
#include "tests/offboard/log/sample_log.h"

namespace vantage {
namespace {

namespace fs = std::filesystem;

class Check : public LogFolder {
 protected:
  LogCheck check() {
    lines_.str("");
    return check_log(log_, lines_);
  }
  void expect_one_fault(const std::string& fault) {
    EXPECT_EQ(check().faults, 1);
    EXPECT_EQ(lines_.str(), fault + "\n");
  }
  std::vector<LogEvent> events() const {
    std::vector<LogEvent> all;
    LogReader reader(log_);
    for (LogEvent event; reader.next(&event);) all.push_back(event);
    return all;
  }
  void set_byte(std::uint64_t offset, char value) {
    std::fstream file(log_, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(static_cast<std::streamoff>(offset));
    file.put(value);
  }
  std::ostringstream lines_;
};

TEST_F(Check, AWholeLogHasNoFault) {
  write_sample_log(log_, 4, {.part_bytes = 10'000});
  ASSERT_GT(count_log_parts(log_), 1u);
  const LogCheck found = check();
  EXPECT_EQ(found.faults, 0) << lines_.str();
  EXPECT_EQ(found.events, 1 + 4 * 7);
  EXPECT_EQ(found.whole_maps, 4);
  EXPECT_EQ(found.unknown, 4);
}

TEST_F(Check, DamageIsPassedAndEachPlaceNamed) {
  write_sample_log(log_, 2);
  const std::vector<LogEvent> all = events();
  set_byte(all[2].offset, 'x');
  set_byte(all[5].offset + 24, 'x');  // its length
  const LogCheck found = check();
  EXPECT_EQ(found.faults, 2);
  EXPECT_EQ(found.events, static_cast<std::int64_t>(all.size()) - 2);
  EXPECT_NE(lines_.str().find("log.lcm: at byte " + std::to_string(all[2].offset) +
                              ": the log is damaged (no event begins here) (" +
                              std::to_string(all[3].offset - all[2].offset) + " bytes to the next whole event)\n"),
            std::string::npos)
      << lines_.str();
  EXPECT_NE(lines_.str().find("at byte " + std::to_string(all[5].offset)), std::string::npos) << lines_.str();
  EXPECT_EQ(read_log_info(log_).damaged_places, 2);
}

TEST_F(Check, ATornEndIsNamed) {
  write_sample_log(log_, 1);
  const LogEvent last = events().back();
  fs::resize_file(log_, last.offset + 100);
  expect_one_fault(log_.string() + ": at byte " + std::to_string(last.offset) +
                   ": the log ends within an event (100 bytes of it)");
  EXPECT_EQ(read_log_info(log_).torn_bytes, 100u);
}

TEST_F(Check, MessagesThatDoNotHoldAreNamed) {
  {
    SampleLog log(log_);
    log.raw(1, channel::kRobotState, "short");
    std::vector<std::uint8_t> state = encode_message(robot_state_t{});
    state.pop_back();
    log.raw(2, channel::kRobotState, {reinterpret_cast<const char*>(state.data()), state.size()});
    depth_map_t map = pack_depth_map(sample_map(1));
    map.quaternion_xyzw[0] = 3;
    log.write(3, channel::kDepthMap, map);
    session_config_t config;
    config.yaml = "config_version: 99\n";
    log.write(4, channel::kSessionConfig, config);
  }
  EXPECT_EQ(check().faults, 4);
  const std::vector<std::string> faults{
      ": event 0, byte 0: VANTAGE_ROBOT_STATE_1: is of another type or version than its channel says",
      ": event 1, byte 54: VANTAGE_ROBOT_STATE_1: is not as long as its content says",
      "VANTAGE_DEPTH_MAP_1: the pose T_world_camera is not finite or not a rotation",
      "VANTAGE_SESSION_CONFIG_1: configuration:1: config_version: "};
  std::istringstream lines(lines_.str());
  std::string line;
  for (const std::string& fault : faults) {
    ASSERT_TRUE(std::getline(lines, line));
    EXPECT_NE(line.find(fault), std::string::npos) << line;
  }
}

TEST_F(Check, MapsInChunksAreHeldAgainstTheirDigest) {
  auto [manifest, chunks] = in_chunks(sample_map(1));
  ASSERT_GT(chunks.size(), 3u);
  const auto write = [&](std::size_t left_out, bool forged) {
    SampleLog log(log_);
    log.write(1, channel::kDepthManifest, manifest);
    for (std::size_t i = chunks.size(); i-- > 0;) {  // in any order, and twice
      depth_map_chunk_t chunk = chunks[i];
      if (forged && i == 1) chunk.data[7] ^= 1;
      if (i != left_out) log.write(2, channel::kDepthChunk, chunk);
      if (i != left_out) log.write(2, channel::kDepthChunk, chunk);
    }
    log.write(3, channel::kDepthManifest, manifest);
  };
  write(chunks.size(), false);
  LogCheck found = check();
  EXPECT_EQ(found.faults, 0) << lines_.str();
  EXPECT_EQ(found.maps_in_chunks, 1);

  write(2, false);
  expect_one_fault(log_.string() + ": event 0, byte 0: " + channel::kDepthManifest + ": depth map 1: 1 of " +
                   std::to_string(chunks.size()) + " chunks are missing");

  write(chunks.size(), true);
  EXPECT_EQ(check().faults, 1);
  EXPECT_NE(lines_.str().find("depth map 1 is whole but not what was announced (its digest differs)"),
            std::string::npos)
      << lines_.str();

  manifest.chunks += 1;
  write(chunks.size(), false);
  found = check();
  EXPECT_EQ(found.faults, 2);  // each time it is said
  EXPECT_NE(lines_.str().find("the announced sizes contradict themselves"), std::string::npos);
  EXPECT_EQ(found.foreign_chunks, static_cast<std::int64_t>(2 * chunks.size()));
}

TEST_F(Check, WhatIsNoLogIsAnError) {
  std::ofstream(log_) << "this is text, and long enough to be taken for a header";
  EXPECT_EQ(input_fault([this] { check(); }), log_.string() + ": at byte 0: not an LCM log");
  log_ = folder_ / "none.lcm";
  EXPECT_NE(input_fault([this] { check(); }).find("none.lcm: no such file"), std::string::npos);
}

TEST_F(Check, RandomBytesNeverCrashTheTools) {
  const unsigned seed = 3;
  RecordProperty("seed", static_cast<int>(seed));
  std::mt19937 random(seed);
  {
    SampleLog log(log_);
    log.config(kSampleStart);
    log.state(kSampleStart, Eigen::Isometry3d::Identity());
    log.map(sample_map(1, 8, 6));
    const auto [manifest, chunks] = in_chunks(sample_map(2, 8, 6), 100);
    log.write(kSampleStart, channel::kDepthManifest, manifest);
    for (const depth_map_chunk_t& chunk : chunks) log.write(kSampleStart, channel::kDepthChunk, chunk);
  }
  std::ifstream in(log_, std::ios::binary);
  const std::string good((std::istreambuf_iterator<char>(in)), {});
  int faulty = 0;
  for (int i = 0; i < 500; ++i) {
    std::string bytes = good.substr(0, random() % 4 == 0 ? random() % good.size() + 1 : good.size());
    for (int k = 0; k < 3; ++k) bytes[random() % bytes.size()] = static_cast<char>(random());
    std::ofstream(log_, std::ios::binary) << bytes;
    input_fault([&] {
      if (check().faults > 0) ++faulty;
      std::ostringstream text;
      print_log_info(log_, read_log_info(log_), text);
      cut_log(log_, folder_ / "cut.lcm", {.from = parse_log_time("0"), .to = {}, .channels = ""});
    });
    input_fault([&] { export_mcap(log_, folder_ / "log.mcap"); });
    input_fault([&] { export_cloud(log_, {}, folder_ / "cloud.ply"); });
  }
  EXPECT_GT(faulty, 100);
}

TEST_F(Check, InfoCountsWhatWasWritten) {
  write_sample_log(log_, 4, {.part_bytes = 10'000});
  const LogInfo info = read_log_info(log_);
  EXPECT_EQ(info.parts, count_log_parts(log_));
  EXPECT_EQ(info.events, 29);
  EXPECT_EQ(info.first_utime, kSampleStart);
  EXPECT_EQ(info.last_utime, kSampleStart + 2'100'000);
  ASSERT_EQ(info.channels.size(), 4u);
  const ChannelInfo& states = info.channels.at(channel::kRobotState);
  EXPECT_EQ(states.events, 20);
  EXPECT_EQ(states.bytes, 20u * (8 + 4 * 8 + 1 + 7 * 8));
  EXPECT_EQ(states.first_utime, kSampleStart + 100'000);
  EXPECT_EQ(states.last_utime, kSampleStart + 2'000'000);
  std::ostringstream text;
  print_log_info(log_, info, text);
  for (const char* part :
       {"29 events in ", "time: 2023-11-14 22:13:20.000000 UTC to 2023-11-14 22:13:22.100000 UTC, 2.100000 s",
        "session: region 1.28 x 1.28 x 1.28 m at 0.01 m, gain combined, at most 20 views",
        "CAMERA_OF_SOMEBODY        -                     unknown"}) {
    EXPECT_NE(text.str().find(part), std::string::npos) << text.str();
  }
  EXPECT_NE(text.str().find("  10.000          1940"), std::string::npos) << text.str();  // 19 intervals in 1.9 s
}

}  // namespace
}  // namespace vantage
