#include "offboard/experiment/progress.h"

#include <gtest/gtest.h>

namespace vantage {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

TEST(Progress, CountsViewsAndRunsAtTheirOwnPace) {
  ManualClock clock;
  Progress progress(clock, 10, 4);
  for (int i = 0; i < 10; ++i) {
    clock.advance(milliseconds(300));
    progress.view_made();
  }
  EXPECT_NEAR(progress.left_s(), 4 * Progress::kRunPerView * 0.3, 1e-9) << "no run is done: judged by the views";
  clock.advance(seconds(7));
  progress.run_made();
  EXPECT_NEAR(progress.left_s(), 3 * 7, 1e-9);
  EXPECT_EQ(progress.text(), "0:21 left");
}

TEST(Progress, IsRightAfterViewsFromTheCache) {
  // Of two scenes the first one's views are all in the cache; its two runs take 4 s each. Then 48 views are rendered
  // in half a second each, and the second scene's runs take 4 s again.
  ManualClock clock;
  Progress progress(clock, 48, 4);
  for (int i = 0; i < 2; ++i) {
    clock.advance(seconds(4));
    progress.run_made();
  }
  EXPECT_NEAR(progress.left_s(), 2 * 4 + 48 * 4 / Progress::kRunPerView, 1e-9) << "no view is done: judged by the runs";
  for (int i = 0; i < 12; ++i) {
    clock.advance(milliseconds(500));
    progress.view_made();
  }
  EXPECT_NEAR(progress.left_s(), 2 * 4 + 36 * 0.5, 1e-9) << "from here on exact";
  for (int i = 0; i < 36; ++i) {
    clock.advance(milliseconds(500));
    progress.view_made();
  }
  EXPECT_NEAR(progress.left_s(), 8, 1e-9);
}

TEST(Progress, WithEverythingInTheCacheIsRightFromTheFirstRun) {
  ManualClock clock;
  Progress progress(clock, 0, 100);
  EXPECT_EQ(progress.left_s(), 0) << "nothing is known yet";
  clock.advance(seconds(2));
  progress.run_made();
  EXPECT_NEAR(progress.left_s(), 99 * 2, 1e-9);
  EXPECT_EQ(progress.text(), "3:18 left");
}

TEST(Progress, AViewThatWasThoughtToBeCachedLeavesNoneOwing) {
  ManualClock clock;
  Progress progress(clock, 1, 1);
  clock.advance(seconds(1));
  progress.view_made();
  progress.view_made();  // a damaged file was made again
  progress.run_made();
  EXPECT_EQ(progress.left_s(), 0);
}

}  // namespace
}  // namespace vantage
