#include "lcmtypes/link/depth_codec.h"

#include <cmath>

#include <gtest/gtest.h>

#include "lcmtypes/link/message.h"
#include "tests/lcmtypes/sample_depth_map.h"

namespace vantage {
namespace {

TEST(DepthCodec, KeepsWhatMattersWithinTheStatedErrors) {
  const DepthMap map = sample_depth_map(320, 240);
  std::string why;
  const std::optional<DepthMap> again = unpack_depth_map(pack_depth_map(map), &why);
  ASSERT_TRUE(again) << why;
  EXPECT_EQ(again->utime, map.utime);
  EXPECT_EQ(again->session, map.session);
  EXPECT_EQ(again->map_id, map.map_id);
  EXPECT_EQ(again->goal_id, map.goal_id);
  EXPECT_EQ(again->view_id, map.view_id);
  EXPECT_EQ(again->camera, map.camera);
  EXPECT_EQ(again->state, map.state);
  EXPECT_TRUE(again->T_world_camera.isApprox(map.T_world_camera, 1e-12));
  double nearest = 1e9, furthest = 0;
  for (std::size_t i = 0; i < map.depth_m.size(); ++i) {
    if (map.state[i] == DepthState::kInvalid) continue;
    nearest = std::min(nearest, double{map.depth_m[i]});
    furthest = std::max(furthest, double{map.depth_m[i]});
  }
  for (std::size_t i = 0; i < map.depth_m.size(); ++i) {
    if (map.state[i] == DepthState::kInvalid) continue;
    const double z = double{map.depth_m[i]};
    const double code_error = z * z * (1 / nearest - 1 / furthest) / 131070;
    ASSERT_NEAR(again->depth_m[i], z, std::max(code_error, double{map.sigma_m[i]} / 16) + 1e-7) << i;
    ASSERT_NEAR(again->sigma_m[i] / map.sigma_m[i], 1, 0.033) << i;
  }
}

TEST(DepthCodec, AnExactMapKeepsAllSixteenBits) {
  DepthMap map = sample_depth_map(64, 48);
  double nearest = 1e9, furthest = 0;
  for (std::size_t i = 0; i < map.depth_m.size(); ++i) {
    if (map.state[i] == DepthState::kInvalid) continue;
    map.sigma_m[i] = 1e-6F;
    nearest = std::min(nearest, double{map.depth_m[i]});
    furthest = std::max(furthest, double{map.depth_m[i]});
  }
  std::string why;
  const std::optional<DepthMap> again = unpack_depth_map(pack_depth_map(map), &why);
  ASSERT_TRUE(again) << why;
  for (std::size_t i = 0; i < map.depth_m.size(); ++i) {
    if (map.state[i] == DepthState::kInvalid) continue;
    const double z = double{map.depth_m[i]};
    ASSERT_NEAR(again->depth_m[i], z, z * z * (1 / nearest - 1 / furthest) / 131070 + 1e-7) << i;
  }
}

TEST(DepthCodec, ADenseMapWithNoiseOnEveryPixelStaysBelow400kB) {
  for (unsigned seed = 1; seed <= 3; ++seed) {
    EXPECT_LE(encode_message(pack_depth_map(sample_depth_map(640, 480, seed))).size(), 400'000u) << seed;
  }
}

TEST(DepthCodec, PackingAgainMovesNothingBeyondTheStatedErrors) {
  std::string why;
  const depth_map_t once = pack_depth_map(sample_depth_map());
  const depth_map_t twice = pack_depth_map(*unpack_depth_map(once, &why));
  const auto a = unpack_depth_map(once, &why), b = unpack_depth_map(twice, &why);
  ASSERT_TRUE(a && b);
  for (std::size_t i = 0; i < a->depth_m.size(); ++i) {
    ASSERT_NEAR(a->depth_m[i], b->depth_m[i], a->sigma_m[i] / 16 + 1e-6F);
  }
  EXPECT_EQ(a->sigma_m, b->sigma_m);
}

TEST(DepthCodec, AMapWithoutDepthSurvives) {
  DepthMap map = sample_depth_map();
  map.state.assign(map.state.size(), DepthState::kDiverged);
  std::string why;
  const auto again = unpack_depth_map(pack_depth_map(map), &why);
  ASSERT_TRUE(again) << why;
  EXPECT_EQ(again->state, map.state);
}

TEST(DepthCodec, RefusesWhatDoesNotHold) {
  const depth_map_t good = pack_depth_map(sample_depth_map());
  const auto reason = [](const depth_map_t& message) {
    std::string why;
    EXPECT_FALSE(unpack_depth_map(message, &why));
    return why;
  };
  depth_map_t bad = good;
  bad.position[1] = std::nan("");
  EXPECT_NE(reason(bad).find("pose"), std::string::npos);
  bad = good;
  bad.quaternion_xyzw[0] = std::nan("");
  EXPECT_NE(reason(bad).find("pose"), std::string::npos);
  bad = good;
  bad.width += 1;
  EXPECT_NE(reason(bad).find("unpack"), std::string::npos);
  bad = good;
  bad.width = bad.height = 30000;
  EXPECT_NE(reason(bad).find("2^24"), std::string::npos);
  bad = good;
  bad.height = 0;
  EXPECT_NE(reason(bad).find("height"), std::string::npos);
  bad = good;
  bad.images.resize(bad.images.size() / 2);
  EXPECT_NE(reason(bad).find("unpack"), std::string::npos);
  bad = good;
  bad.inverse_depth_range[0] = -1;
  EXPECT_NE(reason(bad).find("inverse depth"), std::string::npos);
}

TEST(DepthMap, ValidNamesTheFault) {
  std::string why;
  const DepthMap good = sample_depth_map();
  ASSERT_TRUE(good.valid(&why)) << why;
  DepthMap bad = good;
  bad.depth_m.pop_back();
  EXPECT_FALSE(bad.valid(&why));
  EXPECT_NE(why.find("pixels"), std::string::npos);
  bad = good;
  bad.T_world_camera.linear() *= 2;
  EXPECT_FALSE(bad.valid(&why));
  bad = good;
  bad.T_world_camera.linear().col(0) *= -1;  // a mirror is no rotation
  EXPECT_FALSE(bad.valid(&why));
  bad = good;
  bad.state[5] = DepthState::kConverged;
  bad.sigma_m[5] = 0;
  EXPECT_FALSE(bad.valid(&why));
  EXPECT_NE(why.find("pixel 5"), std::string::npos);
}

}  // namespace
}  // namespace vantage
