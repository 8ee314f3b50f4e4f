#include "lcmtypes/link/depth_map_spool.h"

#include <fstream>
#include <random>

#include <gtest/gtest.h>

#include "calib/files/input_error.h"
#include "lcmtypes/link/depth_codec.h"
#include "lcmtypes/link/depth_map_receiver.h"
#include "lcmtypes/link/depth_map_sender.h"
#include "lcmtypes/link/memory_bus.h"
#include "tests/lcmtypes/sample_depth_map.h"

namespace vantage {
namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;

class SpoolTest : public testing::Test {
 protected:
  void SetUp() override { fs::remove_all(folder_); }
  void TearDown() override { fs::remove_all(folder_); }
  static depth_map_t map(unsigned id) { return pack_depth_map(sample_depth_map(32, 24, id)); }
  int files() const {
    int count = 0;
    for (const auto& file : fs::directory_iterator(folder_)) count += file.path().extension() == ".map";
    return count;
  }
  const fs::path folder_ = fs::path(testing::TempDir()) /
                           (std::string("spool_") + testing::UnitTest::GetInstance()->current_test_info()->name());
};

TEST_F(SpoolTest, OutlivesTheProgramInOrder) {
  {
    DepthMapSpool spool({.folder = folder_});
    for (unsigned i = 1; i <= 12; ++i) spool.push(map(i));
    spool.erase(3);
  }
  DepthMapSpool again({.folder = folder_});
  ASSERT_EQ(again.size(), 11u);
  EXPECT_EQ(again.taken_over(), 11u);
  EXPECT_EQ(again[0].bytes, encode_message(map(1)));
  EXPECT_EQ(again[3].map_id, 5);
  again.push(map(13));
  EXPECT_EQ(again[11].map_id, 13);
  for (int i = 0; i < 12; ++i) again.erase(0);
  EXPECT_EQ(files(), 0);
}

TEST_F(SpoolTest, TheOldestLeavesMemoryAndDiskWhereTheLimitIsReached) {
  const std::uint64_t one = encode_message(map(1)).size();
  DepthMapSpool spool({.folder = folder_, .most_bytes = 3 * one + one / 2});
  for (unsigned i = 1; i <= 5; ++i) spool.push(map(i));
  EXPECT_EQ(spool.size(), 3u);
  EXPECT_EQ(spool.given_up(), 2u);
  EXPECT_EQ(spool[0].map_id, 3);
  EXPECT_EQ(files(), 3);
}

TEST_F(SpoolTest, ASingleMapAboveTheLimitStays) {
  DepthMapSpool spool({.folder = {}, .most_bytes = 10});
  spool.push(map(1));
  EXPECT_EQ(spool.size(), 1u);
  spool.push(map(2));
  ASSERT_EQ(spool.size(), 1u);
  EXPECT_EQ(spool[0].map_id, 2);
}

TEST_F(SpoolTest, DamagedFilesAreCountedAndStay) {
  {
    DepthMapSpool spool({.folder = folder_});
    for (unsigned i = 1; i <= 3; ++i) spool.push(map(i));
  }
  fs::resize_file(folder_ / "000000000002.map", 100);
  std::ofstream(folder_ / "notes.txt") << "somebody's";
  std::ofstream(folder_ / "000000000009.map.tmp-123") << "half";
  DepthMapSpool again({.folder = folder_});
  EXPECT_EQ(again.size(), 2u);
  EXPECT_EQ(again.unreadable(), 1u);
  EXPECT_TRUE(fs::exists(folder_ / "000000000002.map"));
  EXPECT_TRUE(fs::exists(folder_ / "notes.txt"));
  EXPECT_FALSE(fs::exists(folder_ / "000000000009.map.tmp-123"));
}

TEST_F(SpoolTest, TwoProgramsDoNotShareAFolder) {
  DepthMapSpool spool({.folder = folder_});
  EXPECT_THROW(DepthMapSpool({.folder = folder_}), InputError);
}

TEST_F(SpoolTest, AFolderThatCannotBeIsNamed) {
  std::ofstream(folder_) << "a file";
  EXPECT_THROW(DepthMapSpool({.folder = folder_}), InputError);
}

/// Twenty starts of the robot, each killed after a while with maps unacknowledged, and as many of the workstation.
TEST_F(SpoolTest, NoMapIsLostOrTakenTwiceOverRestartsOfBothSides) {
  const unsigned seed = 7;
  RecordProperty("seed", static_cast<int>(seed));
  std::mt19937 random(seed);
  ManualClock clock;
  std::vector<depth_map_t> log;  // what the workstation has on disk
  std::int64_t made = 0;
  for (int life = 0; life <= 20; ++life) {
    MemoryBus bus;
    bus.set_fate([&random](std::string_view) { return random() % 5 == 0 ? 0 : 1; });
    DepthMapReceiver receiver(bus, clock, [&log](const depth_map_t& m) { log.push_back(m); });
    for (const depth_map_t& m : log) receiver.remember(m.session, m.map_id, digest_of(encode_message(m)));
    DepthMapSender sender(bus, clock, {.rate_bit_s = 1e6, .spool = {.folder = folder_}});
    const int rounds = life == 20 ? 100'000 : static_cast<int>(random() % 60);
    for (int t = 0; t < rounds && !(life == 20 && sender.idle()); ++t) {
      if (life < 20 && random() % 20 == 0) {
        depth_map_t next = map(static_cast<unsigned>(made % 5 + 1));
        next.session = life + 1;
        next.map_id = ++made;
        sender.enqueue(next);
      }
      clock.advance(milliseconds(1));
      sender.step();
      receiver.step();
      while (bus.handle(milliseconds(0))) {
      }
    }
  }
  ASSERT_GT(made, 20);
  std::vector<std::int64_t> ids;
  for (const depth_map_t& m : log) ids.push_back(m.map_id);
  std::sort(ids.begin(), ids.end());
  ASSERT_EQ(ids.size(), static_cast<std::size_t>(made));
  for (std::size_t i = 0; i < ids.size(); ++i) EXPECT_EQ(ids[i], static_cast<std::int64_t>(i) + 1);
  EXPECT_EQ(files(), 0);
}

}  // namespace
}  // namespace vantage
