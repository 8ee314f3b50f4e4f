#include "offboard/log/log_cut.h"

#include "offboard/replay.h"
#include "tests/input_fault.h"
#include "tests/offboard/log/log_folder.h"
#include "tests/offboard/log/sample_log.h"

namespace vantage {
namespace {

namespace fs = std::filesystem;

class Cut : public LogFolder {
 protected:
  void SetUp() override {
    LogFolder::SetUp();
    write_sample_log(log_, 4, {.part_bytes = 10'000});
    all_ = read(log_);
  }
  static std::vector<LogEvent> read(const fs::path& log) {
    std::vector<LogEvent> events;
    LogReader reader(log);
    for (LogEvent event; reader.next(&event);) events.push_back(event);
    return events;
  }
  static CutOptions times(const std::string& from, const std::string& to) {
    CutOptions options;
    if (!from.empty()) options.from = parse_log_time(from);
    if (!to.empty()) options.to = parse_log_time(to);
    return options;
  }
  std::vector<LogEvent> all_;
};

TEST_F(Cut, TimesAreSecondsOrClockFromTheStartOrUnix) {
  EXPECT_EQ(parse_log_time("12.5")->us, 12'500'000);
  EXPECT_EQ(parse_log_time("01:02:03.5")->us, 3'723'500'000);
  EXPECT_FALSE(parse_log_time("01:02:03.5")->since_1970);
  EXPECT_EQ(parse_log_time("1700000000.25")->us, 1'700'000'000'250'000);
  EXPECT_TRUE(parse_log_time("1700000000.25")->since_1970);
  for (const char* bad : {"", "x", "1s", "-1", "nan", "inf", "1:2", "1:60:0", "1.5:0:0", "0:0:60", "1:2:3:4", "1e99"}) {
    EXPECT_FALSE(parse_log_time(bad)) << bad;
  }
}

TEST_F(Cut, KeepsWhatIsWithinAndTheConfigurationBeforeIt) {
  for (const auto& [from, to] : {std::pair{"1.0", "2.0"}, {"0:0:1", "00:00:02.0"}, {"1700000001", "1700000002"}}) {
    const fs::path out = folder_ / "out.lcm";
    const CutResult result = cut_log(log_, out, times(from, to));
    const std::vector<LogEvent> kept = read(out);
    EXPECT_EQ(result.events, static_cast<std::int64_t>(all_.size()));
    EXPECT_EQ(result.kept, static_cast<std::int64_t>(kept.size()));
    std::vector<LogEvent> expected{all_[0]};
    for (const LogEvent& event : all_) {
      if (event.utime >= kSampleStart + 1'000'000 && event.utime < kSampleStart + 2'000'000) expected.push_back(event);
    }
    ASSERT_EQ(kept.size(), expected.size());
    for (std::size_t i = 0; i < kept.size(); ++i) {
      EXPECT_EQ(kept[i].number, static_cast<std::int64_t>(i));
      EXPECT_EQ(kept[i].utime, expected[i].utime);
      EXPECT_EQ(kept[i].channel, expected[i].channel);
      EXPECT_EQ(kept[i].bytes, expected[i].bytes);
    }
  }
}

TEST_F(Cut, CanBeReplayed) {
  cut_log(log_, folder_ / "out.lcm", times("1.0", "2.0"));
  const LogContents contents = examine_log(folder_ / "out.lcm");
  EXPECT_TRUE(contents.config);
  EXPECT_EQ(contents.depth_maps, 2);  // logged after 1.1 s and 1.6 s
}

TEST_F(Cut, ChannelsAreChosenByTheirWholeName) {
  CutOptions options;
  options.channels = "VANTAGE_DEPTH.*|CAMERA";
  EXPECT_EQ(cut_log(log_, folder_ / "out.lcm", options).kept, 1 + 4);
  options.channels = "VANTAGE_ROBOT_STATE_1";
  EXPECT_EQ(cut_log(log_, folder_ / "out.lcm", options).kept, 1 + 20);
  options.channels = "(";
  EXPECT_NE(
      input_fault([&] { cut_log(log_, folder_ / "out.lcm", options); }).find("--channels (: is no regular expression"),
      std::string::npos);
}

TEST_F(Cut, InAnotherFolderTheConfigurationReachesTheSameFiles) {
  SessionConfig config;
  config.truth = "truth.ply";
  config.planning->views = "views.txt";
  {
    SampleLog log(log_);
    log.config(1, config);
    log.map(sample_map(1));
  }
  const fs::path other = folder_ / "other" / "folder";
  fs::create_directories(other);
  const auto config_in = [](const fs::path& log) {
    session_config_t message;
    DecodeCounters counters;
    EXPECT_TRUE(decode_message(read(log).front().bytes, &message, &counters));
    return parse_session_config(message.yaml, "", log.parent_path());
  };
  cut_log(log_, other / "out.lcm", {});
  EXPECT_EQ(config_in(other / "out.lcm").truth.lexically_normal(), folder_ / "truth.ply");
  EXPECT_EQ(config_in(other / "out.lcm").planning->views.lexically_normal(), folder_ / "views.txt");
  cut_log(log_, folder_ / "out.lcm", {});
  EXPECT_EQ(read(folder_ / "out.lcm").front().bytes, read(log_).front().bytes);
}

TEST_F(Cut, DamageAndATornEndStayOut) {
  const fs::path last = log_part(log_, count_log_parts(log_) - 1);
  fs::resize_file(last, fs::file_size(last) - 1);
  {
    std::fstream file(log_, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(static_cast<std::streamoff>(all_[3].offset));
    file.put('x');
  }
  const CutResult result = cut_log(log_, folder_ / "out.lcm", {});
  EXPECT_EQ(result.damaged_places, 1);
  EXPECT_EQ(result.torn_bytes, EventHeader::kBytes + all_.back().channel.size() + all_.back().bytes.size() - 1);
  EXPECT_EQ(read(folder_ / "out.lcm").size(), all_.size() - 2);
}

TEST_F(Cut, NothingIsWrittenWhenNothingIsKept) {
  EXPECT_NE(input_fault([this] { cut_log(log_, folder_ / "out.lcm", times("100", "")); }).find("no event is within"),
            std::string::npos);
  EXPECT_EQ(static_cast<std::size_t>(std::distance(fs::directory_iterator(folder_), fs::directory_iterator())),
            count_log_parts(log_));
}

}  // namespace
}  // namespace vantage
