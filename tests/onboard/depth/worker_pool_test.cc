#include "onboard/depth/worker_pool.h"

#include <array>

#include <gtest/gtest.h>

namespace vantage {
namespace {

TEST(WorkerPoolTest, DoesEveryChunkOnce) {
  for (const int threads : {1, 2, 5}) {
    WorkerPool pool(threads);
    EXPECT_EQ(pool.threads(), threads);
    for (const int chunks : {0, 1, 3, 1000}) {
      std::vector<std::atomic<int>> done(static_cast<std::size_t>(chunks));
      pool.run(chunks, [&](int chunk) { ++done[static_cast<std::size_t>(chunk)]; });
      for (const std::atomic<int>& times : done) EXPECT_EQ(times, 1);
    }
  }
}

TEST(WorkerPoolTest, ManyShortRounds) {
  WorkerPool pool(3);
  std::atomic<int> sum = 0;
  for (int round = 0; round < 5000; ++round) pool.run(4, [&](int chunk) { sum += chunk; });
  EXPECT_EQ(sum, 5000 * 6);
}

}  // namespace
}  // namespace vantage
