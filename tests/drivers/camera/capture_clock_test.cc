#include "drivers/camera/capture_clock.h"

#include <random>

#include <gtest/gtest.h>

namespace vantage {
namespace {

using std::chrono::milliseconds;
using std::chrono::nanoseconds;
using std::chrono::seconds;

constexpr milliseconds kPeriod{33};

TEST(CaptureClock, GoodStampsPassAsTheyAreAfterTheFirstFew) {
  CaptureClock clock(kPeriod);
  nanoseconds now = seconds(100);
  for (int i = 0; i < 50; ++i, now += kPeriod) {
    const nanoseconds stamp = now - milliseconds(10 + i % 5);
    const auto time = clock.capture_time(stamp, now);
    ASSERT_EQ(time.has_value(), i >= 4);
    if (time) {
      EXPECT_EQ(*time, stamp);
    }
  }
  EXPECT_EQ(clock.verdict(), CaptureClock::Verdict::kGood);
}

TEST(CaptureClock, AnotherClocksOffsetIsTakenOffToHalfAFrame) {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> jitter(0, 5e6);
  for (const nanoseconds offset :
       {nanoseconds(seconds(29)), nanoseconds(seconds(-3)), nanoseconds(milliseconds(-60))}) {
    CaptureClock clock(kPeriod);
    nanoseconds now = seconds(100);
    for (int i = 0; i < 50; ++i, now += kPeriod) {
      const nanoseconds captured = now - milliseconds(12) - nanoseconds(static_cast<std::int64_t>(jitter(random)));
      const auto time = clock.capture_time(captured - offset, now);
      if (!time) continue;
      EXPECT_LT(std::abs((*time - captured).count()), nanoseconds(kPeriod).count() / 2 + 6'000'000);
      EXPECT_LE(*time, now);
    }
    EXPECT_EQ(clock.verdict(), CaptureClock::Verdict::kCorrected);
    EXPECT_NEAR(static_cast<double>((clock.offset() - offset).count()), 0, 33e6);
  }
}

TEST(CaptureClock, StampsWithoutAClockAreRefused) {
  CaptureClock clock(kPeriod);
  nanoseconds now = seconds(100);
  std::mt19937_64 random(5);
  for (int i = 0; i < 10; ++i, now += kPeriod) {
    EXPECT_FALSE(clock.capture_time(nanoseconds(static_cast<std::int64_t>(random() % 1'000'000'000'000)), now));
  }
  EXPECT_EQ(clock.verdict(), CaptureClock::Verdict::kRefused);
  EXPECT_EQ(clock.text(), "the driver's time stamps follow no steady clock; its frames are refused");
}

TEST(CaptureClock, ASingleStampOfTheFutureIsNoCaptureTime) {
  CaptureClock clock(kPeriod);
  nanoseconds now = seconds(100);
  for (int i = 0; i < 10; ++i, now += kPeriod) clock.capture_time(now - milliseconds(5), now);
  EXPECT_FALSE(clock.capture_time(now + milliseconds(1), now));
  EXPECT_TRUE(clock.capture_time(now - milliseconds(1), now));
}

TEST(CaptureClock, FramesThatWaitedInTheQueueAtTheStartAreNoOtherClock) {
  CaptureClock clock(kPeriod);
  nanoseconds now = seconds(100);
  // The consumer came late: four frames lie there, up to 130 ms old, then they come fresh.
  for (int i = 4; i > 0; --i) clock.capture_time(now - i * nanoseconds(kPeriod), now);
  clock.capture_time(now - milliseconds(8), now);
  EXPECT_EQ(clock.verdict(), CaptureClock::Verdict::kGood);
}

}  // namespace
}  // namespace vantage
