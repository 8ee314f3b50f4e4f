#include "lcmtypes/link/event_log.h"

#include <functional>
#include <random>

#include <gtest/gtest.h>
#include <lcm/eventlog.h>

#include "calib/files/input_error.h"

namespace vantage {
namespace {

namespace fs = std::filesystem;

class EventLog : public testing::Test {
 protected:
  void SetUp() override {
    path_ = fs::path(testing::TempDir()) /
            (std::string(testing::UnitTest::GetInstance()->current_test_info()->name()) + ".lcm");
    LogWriter writer(path_);
    for (int i = 0; i < 5; ++i) {
      writer.write(1000 + i, "CHANNEL_" + std::to_string(i),
                   std::vector<std::uint8_t>(static_cast<std::size_t>(100 * i), 7));
    }
  }
  std::string fault() {
    try {
      LogReader reader(path_);
      for (LogEvent event; reader.next(&event);) {
      }
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }
  fs::path path_;
};

TEST_F(EventLog, IsReadBackByUsAndByLcm) {
  LogReader reader(path_);
  LogEvent event;
  for (int i = 0; i < 5; ++i) {
    ASSERT_TRUE(reader.next(&event));
    EXPECT_EQ(event.number, i);
    EXPECT_EQ(event.utime, 1000 + i);
    EXPECT_EQ(event.channel, "CHANNEL_" + std::to_string(i));
    EXPECT_EQ(event.bytes.size(), static_cast<std::size_t>(100 * i));
  }
  EXPECT_FALSE(reader.next(&event));

  lcm_eventlog_t* log = lcm_eventlog_create(path_.c_str(), "r");
  ASSERT_NE(log, nullptr);
  for (int i = 0; i < 5; ++i) {
    lcm_eventlog_event_t* theirs = lcm_eventlog_read_next_event(log);
    ASSERT_NE(theirs, nullptr);
    EXPECT_EQ(theirs->timestamp, 1000 + i);
    EXPECT_EQ(theirs->datalen, 100 * i);
    lcm_eventlog_free_event(theirs);
  }
  EXPECT_EQ(lcm_eventlog_read_next_event(log), nullptr);
  lcm_eventlog_destroy(log);
}

TEST_F(EventLog, EveryCutIsFound) {
  const auto whole = fs::file_size(path_);
  int clean_ends = 0;
  for (auto size = whole - 1; size > 0; --size) {
    fs::resize_file(path_, size);
    if (fault().empty()) ++clean_ends;
  }
  EXPECT_EQ(clean_ends, 4);  // only between two events
  fs::resize_file(path_, 0);
  EXPECT_NE(fault().find("is empty"), std::string::npos);
}

TEST_F(EventLog, DamageIsNamedWithItsPlace) {
  std::fstream file(path_, std::ios::in | std::ios::out | std::ios::binary);
  file.seekp(28 + 9);  // the second event's sync word
  file.put('x');
  file.close();
  EXPECT_EQ(fault(), path_.string() + ": at byte 37: the log is damaged (no event begins here)");
  std::ofstream(path_) << "this is text, and long enough to be taken for a header";
  EXPECT_NE(fault().find("not an LCM log"), std::string::npos);
  fs::remove(path_);
  EXPECT_NE(fault().find("no such file"), std::string::npos);
}

TEST_F(EventLog, RandomBytesNeverCrashTheReader) {
  const unsigned seed = 5;
  RecordProperty("seed", static_cast<int>(seed));
  std::mt19937 random(seed);
  std::ifstream in(path_, std::ios::binary);
  const std::string good((std::istreambuf_iterator<char>(in)), {});
  for (int i = 0; i < 300; ++i) {
    std::string bytes = good;
    for (int k = 0; k < 5; ++k) bytes[random() % bytes.size()] = static_cast<char>(random());
    std::ofstream(path_, std::ios::binary) << bytes;
    fault();
  }
}

}  // namespace
}  // namespace vantage
