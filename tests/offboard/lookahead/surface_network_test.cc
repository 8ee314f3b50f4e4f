#include "offboard/lookahead/surface_network.h"

#include <stdexcept>

#include <gtest/gtest.h>

#include "calib/look_at.h"
#include "offboard/lookahead/surface_network_file.h"
#include "tests/offboard/lookahead/surface_network_answer.h"

namespace vantage {
namespace {

TEST(SurfaceNetwork, RefusesWhatIsNoSuchFile) {
  const std::span<const unsigned char> file = surface_network_file();
  EXPECT_NO_THROW(SurfaceNetwork{file});
  EXPECT_THROW(SurfaceNetwork{file.first(0)}, std::invalid_argument);
  EXPECT_THROW(SurfaceNetwork{file.first(file.size() - 1)}, std::invalid_argument) << "cut short";
  std::vector<unsigned char> changed(file.begin(), file.end());
  changed.push_back(0);
  EXPECT_THROW(SurfaceNetwork{changed}, std::invalid_argument) << "longer";
  changed.pop_back();
  changed[0] ^= 1;
  EXPECT_THROW(SurfaceNetwork{changed}, std::invalid_argument) << "another magic word";
  changed[0] ^= 1;
  changed[16] ^= 1;
  EXPECT_THROW(SurfaceNetwork{changed}, std::invalid_argument) << "another first layer";
}

/// The front of a box (0.2 x 0.2 x 0.2 m on the ground) as a view from +x knows it.
class FrontOfABox : public testing::Test {
 protected:
  FrontOfABox() {
    for (int z = 64; z < 104; ++z) {
      for (int y = 40; y < 88; ++y) {
        for (int x = 40; x < 88; ++x) {
          const bool shadow = y >= 54 && y < 74 && z < 84;
          if (z == 64 && x >= 74) {
            map_.set_log_odds({x, y, z}, 3);  // ground
          } else if (!shadow || x > 74) {
            map_.set_log_odds({x, y, z}, -3);
          } else if (x == 74) {
            map_.set_log_odds({x, y, z}, 3);
          } else {
            map_.set_occlusion_distance({x, y, z}, 0.01 * (74 - x));
          }
        }
      }
    }
    map_.set_has_marks(true);
  }

  OccupancyMap map_;
  const CameraModel camera_{752, 480, 448, 448, 375.5, 239.5, Distortion::kNone, {}};
  const std::vector<CandidateView> ring_ = cylinder_views();  // 0 is at +x
  const std::vector<Eigen::Isometry3d> taken_{ring_[0].T_world_camera};
  const Eigen::Vector3d foot_{0, 0, 0};
};

TEST_F(FrontOfABox, ItsSidesAreExpectedAndTheAirIsNot) {
  const ExpectedSurface surface = SurfaceNetwork::built_in().expect(MapWindow(map_, camera_, taken_, foot_));
  ASSERT_EQ(surface.amount.size(), MapWindow::kVoxels);
  const auto sum = [&](int x_begin, int x_end, int y_begin, int y_end, int z_begin, int z_end) {
    double all = 0;
    for (int z = z_begin; z < z_end; ++z) {
      for (int y = y_begin; y < y_end; ++y) {
        for (int x = x_begin; x < x_end; ++x) all += static_cast<double>(surface.amount[surface.place({x, y, z})]);
      }
    }
    return all;
  };
  const double all = sum(40, 88, 40, 88, 64, 104);
  EXPECT_GT(all, 300) << "the back and two sides have 400 voxels each";
  EXPECT_LT(all, 3000);
  const double right = sum(56, 74, 52, 56, 66, 84), left = sum(56, 74, 72, 76, 66, 84);
  EXPECT_GT(right, 30) << "along the edge of the shadow";
  EXPECT_GT(left, 30);
  EXPECT_LT(sum(76, 88, 40, 88, 66, 104), 0.05 * all) << "what was seen through before it";
}

TEST_F(FrontOfABox, TheWindowStandsOnTheGroundAroundItsFoot) {
  const ExpectedSurface surface = SurfaceNetwork::built_in().expect(MapWindow(map_, camera_, taken_, foot_));
  EXPECT_EQ(surface.min_corner, Eigen::Vector3i(40, 40, 64));
  EXPECT_EQ(surface.place({40, 40, 64}), 0U);
  EXPECT_EQ(surface.place({87, 87, 103}), MapWindow::kVoxels - 1);
  for (const Eigen::Vector3i& outside : {Eigen::Vector3i{39, 64, 70}, {64, 88, 70}, {64, 64, 63}, {64, 64, 104}}) {
    EXPECT_EQ(surface.place(outside), MapWindow::kVoxels) << outside.transpose();
  }
}

TEST_F(FrontOfABox, AmountsLieBetweenNothingAndTheMost) {
  const MapWindow window(map_, camera_, taken_, foot_);
  for (const float amount : SurfaceNetwork::built_in().expect(window.numbers()).amount) {
    ASSERT_GE(amount, 0);
    ASSERT_LE(static_cast<double>(amount), SurfaceNetwork::kMost);
  }
}

TEST(SurfaceNetwork, AnswersAsTheProgramThatLearnedIt) {
  // surface_network_answer.h holds what PyTorch says to the same numbers (scripts/learn-surface-network --answer).
  std::vector<MapWindow::Numbers> numbers(MapWindow::kVoxels);
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    for (std::size_t c = 1; c < MapWindow::kChannels; ++c) {
      numbers[i][c] = static_cast<std::int8_t>((i / 7 + c * 17 + i / 997) % 128);
    }
  }
  const ExpectedSurface surface = SurfaceNetwork::built_in().expect(numbers);
  for (const auto& [voxel, amount, above, level] : kSurfaceNetworkAnswer) {
    const auto i = static_cast<std::size_t>(voxel);
    EXPECT_NEAR(static_cast<double>(surface.amount[i]), amount, 1e-4) << "voxel " << voxel;
    EXPECT_NEAR(value_at(surface.lean[i], Eigen::Vector3d::UnitZ()), above, 1e-3) << "voxel " << voxel;
    EXPECT_NEAR(value_at(surface.lean[i], Eigen::Vector3d(0.6, 0.8, 0)), level, 1e-3) << "voxel " << voxel;
  }
}

}  // namespace
}  // namespace vantage
