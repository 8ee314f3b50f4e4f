#include "offboard/experiment/surface_network.h"

#include <stdexcept>

#include <gtest/gtest.h>

#include "calib/look_at.h"
#include "offboard/experiment/surface_network_file.h"
#include "tests/offboard/experiment/surface_network_answer.h"

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
  const Eigen::Vector3d focus_{0, 0, 0.15};
};

TEST_F(FrontOfABox, ItsSidesAreExpectedAndTheAirIsNot) {
  const std::vector<float> surface = expect_surface(SurfaceNetwork::built_in(), map_, camera_, taken_, focus_);
  ASSERT_EQ(surface.size(), 128U * 128 * 128);
  const auto sum = [&](int x_begin, int x_end, int y_begin, int y_end, int z_begin, int z_end) {
    double all = 0;
    for (int z = z_begin; z < z_end; ++z) {
      for (int y = y_begin; y < y_end; ++y) {
        for (int x = x_begin; x < x_end; ++x)
          all += static_cast<double>(surface[static_cast<std::size_t>(x + 128 * (y + 128 * z))]);
      }
    }
    return all;
  };
  const double all = sum(0, 128, 0, 128, 0, 128);
  EXPECT_GT(all, 300) << "the back and two sides have 400 voxels each";
  EXPECT_LT(all, 3000);
  const double right = sum(56, 74, 52, 56, 66, 84), left = sum(56, 74, 72, 76, 66, 84);
  EXPECT_GT(right, 30) << "along the edge of the shadow";
  EXPECT_GT(left, 30);
  EXPECT_LT(sum(76, 88, 40, 88, 66, 104), 0.05 * all) << "what was seen through before it";
}

TEST_F(FrontOfABox, NothingIsExpectedOutsideTheWindow) {
  const std::vector<float> surface = expect_surface(SurfaceNetwork::built_in(), map_, camera_, taken_, focus_);
  const auto at = [&](int x, int y, int z) { return surface[static_cast<std::size_t>(x + 128 * (y + 128 * z))]; };
  EXPECT_EQ(at(39, 64, 70), 0);
  EXPECT_EQ(at(64, 88, 70), 0);
  EXPECT_EQ(at(64, 64, 63), 0);
  EXPECT_EQ(at(64, 64, 104), 0);
}

TEST_F(FrontOfABox, AmountsLieBetweenNothingAndTheMost) {
  for (const float amount : SurfaceNetwork::built_in().expect(MapWindow(map_, camera_, taken_, focus_).numbers())) {
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
  const std::vector<float> surface = SurfaceNetwork::built_in().expect(numbers);
  for (const auto& [voxel, expected] : kSurfaceNetworkAnswer) {
    EXPECT_NEAR(static_cast<double>(surface[static_cast<std::size_t>(voxel)]), expected, 1e-4) << "voxel " << voxel;
  }
}

}  // namespace
}  // namespace vantage
