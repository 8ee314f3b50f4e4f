#include "offboard/lookahead/set_cover.h"

#include <array>
#include <cstdint>
#include <numeric>
#include <random>
#include <string>

#include <gtest/gtest.h>

namespace vantage {
namespace {

const Eigen::Vector3f kAnywhere = Eigen::Vector3f::Zero();

float mean(const std::array<float, kFacings>& shares) {
  return std::accumulate(shares.begin(), shares.end(), 0.0F) / kFacings;
}

TEST(SetCover, CountsWhatTwoViewsSeeOnce) {
  const std::vector<float> prior{1, 1, 0.5F};
  const std::vector<std::vector<ExpectedVoxel>> views{{{0, 1, kAnywhere}, {1, 0.5F, kAnywhere}},
                                                      {{0, 1, kAnywhere}, {2, 1, kAnywhere}}};
  SetCover cover(views, prior);
  EXPECT_NEAR(cover.gain(0), 1.5, 1e-6);
  EXPECT_NEAR(cover.gain(1), 1.5, 1e-6);
  cover.take(0);
  EXPECT_NEAR(cover.gain(0), 0.25, 1e-6);  // half of voxel 1 is left, of which it sees half
  EXPECT_NEAR(cover.gain(1), 0.5, 1e-6);   // voxel 2 alone is new
  cover.clear();
  EXPECT_NEAR(cover.gain(1), 1.5, 1e-6);
}

TEST(SetCover, OppositeViewsMeasureNothingTwiceAndNeighboursAlmostAll) {
  const Eigen::Vector3f from(0.6F, 0, 0.8F);
  const Eigen::Vector3f near(0.8F, 0, 0.6F);
  const std::vector<float> prior{1};
  const std::vector<std::vector<ExpectedVoxel>> views{{{0, 0.4F, from}}, {{0, 0.4F, -from}}, {{0, 0.4F, near}}};
  SetCover cover(views, prior);
  for (std::size_t view = 0; view < 3; ++view) EXPECT_NEAR(cover.gain(view), 0.4, 1e-5) << view;
  cover.take(0);
  EXPECT_NEAR(cover.gain(1), 0.4, 0.03) << "opposite";
  EXPECT_LT(cover.gain(2), 0.15) << "16 degrees aside";
}

TEST(SetCover, GainsNeverGrowByWhatWasTaken) {
  const unsigned seed = std::random_device{}();
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937 random(seed);
  std::normal_distribution<float> normal;
  for (int round = 0; round < 50; ++round) {
    std::vector<float> prior(40);
    for (float& p : prior) p = static_cast<float>(random() % 5) / 4;
    std::vector<std::vector<ExpectedVoxel>> views(8);
    for (auto& view : views) {
      for (std::uint32_t voxel = 0; voxel < 40; ++voxel) {
        const Eigen::Vector3f direction(normal(random), normal(random), normal(random));
        if (random() % 3 == 0) view.push_back({voxel, static_cast<float>(random() % 5) / 4, direction.normalized()});
      }
    }
    SetCover cover(views, prior);
    std::vector<double> before;
    for (std::size_t view = 0; view < views.size(); ++view) before.push_back(cover.gain(view));
    const std::vector<double> at_first = before;
    for (std::size_t taken = 0; taken < 4; ++taken) {
      cover.take(taken);
      for (std::size_t view = 0; view < views.size(); ++view) {
        ASSERT_LE(cover.gain(view), before[view] + 1e-5) << "round " << round;
        before[view] = cover.gain(view);
      }
    }
    cover.clear();
    for (std::size_t view = 0; view < views.size(); ++view) ASSERT_EQ(cover.gain(view), at_first[view]);
  }
}

TEST(MeasuredByFacing, IsTheGivenShareAndFacesTheCameraMost) {
  std::mt19937 random(3);
  std::normal_distribution<float> normal;
  for (int i = 0; i < 300; ++i) {
    const float share = static_cast<float>(random() % 101) / 100;
    const Eigen::Vector3f to_camera = Eigen::Vector3f(normal(random), normal(random), normal(random)).normalized();
    const std::array<float, kFacings> measured = measured_by_facing(share, to_camera);
    EXPECT_NEAR(mean(measured), share, 1e-5F) << to_camera.transpose();
    for (const float part : measured) {
      EXPECT_GE(part, -1e-6F);
      EXPECT_LE(part, 1 + 1e-6F);
    }
    std::array<float, kFacings> both = measured_by_facing(share, -to_camera);
    for (std::size_t k = 0; k < kFacings; ++k) both[k] *= measured[k];
    EXPECT_LE(mean(both), std::max(0.12F * share, 2 * share - 1) + 0.06F) << "from both sides, share " << share;
  }
}

}  // namespace
}  // namespace vantage
