#include "offboard/experiment/learning_states.h"

#include <bit>
#include <cstring>
#include <fstream>
#include <iterator>
#include <sstream>

#include <gtest/gtest.h>
#include <unistd.h>

#include "calib/files/input_error.h"
#include "offboard/lookahead/map_window.h"
#include "tests/offboard/experiment/box_scene.h"

namespace vantage {
namespace {

class LearningStates : public testing::Test {
 protected:
  void SetUp() override { std::filesystem::remove_all(folder_); }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  static LearningStatesOptions options() {
    LearningStatesOptions options;
    options.scenes.run.views = 3;
    options.scenes.run.truth_points = 2000;
    options.runs = 3;
    options.scenes.threads = 2;
    options.scenes.candidates = six_views();
    return options;
  }
  std::string write() {
    const std::atomic<bool> stop = false;
    std::ostringstream terminal;
    EXPECT_TRUE(write_learning_states({box_object()}, options(), folder_, stop, terminal));
    std::ifstream file(folder_ / "box-seed1.states", std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  template <typename T>
  static T at(const std::string& bytes, std::size_t offset) {
    T value;
    std::memcpy(&value, bytes.data() + offset, sizeof value);
    return value;
  }

  const std::filesystem::path folder_ = testing::TempDir() + "learning-states-" + std::to_string(::getpid());
};

TEST_F(LearningStates, HoldWhatTheHeaderSays) {
  const std::string bytes = write();
  ASSERT_EQ(bytes.substr(0, 16), "VANTAGE-STATES-2");
  const auto number = [&](std::size_t i) { return at<std::uint32_t>(bytes, 16 + 4 * i); };
  EXPECT_EQ(number(0), std::uint32_t{MapWindow::kChannels});
  const std::size_t voxels = std::size_t{number(1)} * number(1) * number(2), candidates = number(3), points = number(4),
                    states = number(5);
  EXPECT_EQ(voxels, MapWindow::kVoxels);
  EXPECT_EQ(candidates, 6U);
  EXPECT_EQ(points, 2000U);
  EXPECT_EQ(states, 6U) << "two of each run: none after the last view";
  std::size_t begin = 44 + 12 * candidates + 12 * points;

  // Views come one by one; each covers points, and what the map holds grows.
  std::uint64_t before = 0;
  for (std::size_t state = 0; state < states; ++state) {
    const auto taken = at<std::uint64_t>(bytes, begin);
    EXPECT_EQ(std::popcount(taken), state % 2 == 0 ? 1 : 2);
    if (state % 2 == 1) {
      EXPECT_EQ(taken & before, before);
    }
    before = taken;
    std::size_t covered = 0, occupied = 0;
    for (std::size_t i = 0; i < points; ++i) {
      const auto covering = at<std::uint64_t>(bytes, 44 + 12 * candidates + 4 * points + 8 * i);
      ASSERT_LT(covering, std::uint64_t{1} << candidates);
      covered += (covering & taken) != 0;
    }
    for (std::size_t v = 0; v < voxels; ++v) {
      occupied += bytes[begin + 8 + v * MapWindow::kChannels + MapWindow::kOccupied] != 0;
    }
    EXPECT_GT(covered, points / 20) << "state " << state;
    EXPECT_GT(occupied, 200U) << "state " << state;

    // Views that are still open are expected to see unknown voxels, and the others nothing.
    const std::size_t seen_at = begin + 8 + voxels * MapWindow::kChannels;
    const auto seen = at<std::uint32_t>(bytes, seen_at);
    EXPECT_GT(seen, 50U) << "state " << state;
    for (std::size_t i = 0; i < seen; ++i) {
      const std::size_t entry = seen_at + 4 + i * (4 + candidates);
      const auto voxel = at<std::uint32_t>(bytes, entry);
      ASSERT_LT(voxel, voxels);
      EXPECT_EQ(bytes[begin + 8 + voxel * MapWindow::kChannels + MapWindow::kOccupied], 0);
      for (std::size_t view = 0; view < candidates; ++view) {
        if (taken >> view & 1) {
          EXPECT_EQ(bytes[entry + 4 + view], 0);
        }
      }
    }
    begin = seen_at + 4 + seen * (4 + candidates);
  }
  EXPECT_EQ(bytes.size(), begin);
}

TEST_F(LearningStates, PointsLieInTheVoxelsThatTheMapCallsOccupied) {
  const std::string bytes = write();
  const std::size_t points = 2000, voxels_at = 44 + 12 * 6, covering_at = voxels_at + 4 * points,
                    begin = covering_at + 8 * points;
  const auto taken = at<std::uint64_t>(bytes, begin);
  std::size_t covered = 0, in_occupied = 0;
  for (std::size_t i = 0; i < points; ++i) {
    const auto voxel = at<std::int32_t>(bytes, voxels_at + 4 * i);
    if ((at<std::uint64_t>(bytes, covering_at + 8 * i) & taken) == 0) continue;
    ASSERT_GE(voxel, 0);
    ++covered;
    in_occupied +=
        bytes[begin + 8 + static_cast<std::size_t>(voxel) * MapWindow::kChannels + MapWindow::kOccupied] != 0;
  }
  EXPECT_GT(in_occupied, covered / 4)
      << "the box's sides lie on voxel faces: half of the points are in the voxel beside";
}

TEST_F(LearningStates, AreTheSameEachTime) { EXPECT_EQ(write(), write()); }

TEST_F(LearningStates, AFolderThatCannotBeMadeIsNamed) {
  std::ofstream(folder_) << "a file";
  const std::atomic<bool> stop = false;
  std::ostringstream terminal;
  try {
    write_learning_states({box_object()}, options(), folder_ / "states", stop, terminal);
    FAIL() << "no error";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("states"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace vantage
