#include "onboard/depth/key_frame_policy.h"

#include <gtest/gtest.h>

namespace vantage {
namespace {

UpdateCounts counts(int converged, int others) {
  UpdateCounts c;
  c.states[static_cast<std::size_t>(PixelState::kConverged)] = converged;
  c.states[static_cast<std::size_t>(PixelState::kUpdating)] = others;
  c.states[static_cast<std::size_t>(PixelState::kBorder)] = 500;  // do not count
  return c;
}

TEST(KeyFramePolicyTest, EndsWhenEnoughHasConverged) {
  KeyFramePolicy policy({.enough_converged = 0.8});
  policy.begin();
  policy.add(counts(79, 21), 1);
  EXPECT_EQ(policy.end(), KeyFrameEnd::kNotYet);
  policy.add(counts(80, 20), 1);
  EXPECT_EQ(policy.end(), KeyFrameEnd::kEnoughConverged);
}

TEST(KeyFramePolicyTest, EndsWhenNoMoreWill) {
  KeyFramePolicy policy({.stall_frames = 5, .stall_gain = 0.02});
  policy.begin();
  policy.add(counts(30, 70), 1);
  for (int i = 0; i < 4; ++i) policy.add(counts(31, 69), 1);
  EXPECT_EQ(policy.end(), KeyFrameEnd::kNotYet);
  policy.add(counts(31, 69), 1);
  EXPECT_EQ(policy.end(), KeyFrameEnd::kNoMoreWill);
}

TEST(KeyFramePolicyTest, WaitsForACameraThatStandsStill) {
  KeyFramePolicy policy({.stall_frames = 5, .most_frames = 50});
  policy.begin();
  for (int i = 0; i < 49; ++i) policy.add(counts(0, 100), 1);
  EXPECT_EQ(policy.end(), KeyFrameEnd::kNotYet);
  policy.add(counts(0, 100), 1);
  EXPECT_EQ(policy.end(), KeyFrameEnd::kMostFrames);
}

TEST(KeyFramePolicyTest, EndsWhenTheViewMovesAway) {
  KeyFramePolicy policy({.least_visible = 0.5});
  policy.begin();
  policy.add(counts(10, 90), 0.51);
  EXPECT_EQ(policy.end(), KeyFrameEnd::kNotYet);
  policy.add(counts(10, 90), 0.49);
  EXPECT_EQ(policy.end(), KeyFrameEnd::kViewMovedAway);
  policy.begin();
  EXPECT_EQ(policy.end(), KeyFrameEnd::kNotYet);
}

TEST(KeyFramePolicyTest, OptionsAreChecked) {
  std::string why;
  EXPECT_FALSE(KeyFrameOptions{.enough_converged = 1.2}.valid(&why));
  EXPECT_FALSE(why.empty());
  EXPECT_FALSE(KeyFrameOptions{.stall_frames = 0}.valid());
  EXPECT_TRUE(KeyFrameOptions{}.valid());
}

}  // namespace
}  // namespace vantage
