#include "lcmtypes/link/depth_edges.h"

#include <gtest/gtest.h>

namespace vantage {
namespace {

/// All pixels measured at 1 m but for the columns from `step` on, which are at `depth_m`.
DepthMap step_map(int width, int height, int step, float depth_m) {
  DepthMap map;
  map.camera = {width, height, 100, 100, width / 2.0, height / 2.0, Distortion::kNone, {}};
  for (int i = 0; i < width * height; ++i) map.depth_m.push_back(i % width < step ? 1.0F : depth_m);
  map.sigma_m.assign(map.depth_m.size(), 0.001F);
  map.state.assign(map.depth_m.size(), DepthState::kConverged);
  return map;
}

std::string row_of(const DepthMap& map, int row) {
  std::string text;
  for (int u = 0; u < map.camera.width; ++u) {
    const DepthState state = map.state[static_cast<std::size_t>(row * map.camera.width + u)];
    text += state == DepthState::kEdge ? 'E' : state == DepthState::kConverged ? '.' : ' ';
  }
  return text;
}

TEST(DepthEdges, AStepIsMarkedToTheRadiusOnBothSides) {
  DepthMap map = step_map(12, 5, 6, 1.5F);
  mark_depth_edges(&map, {.radius_px = 2});
  for (int v = 0; v < 5; ++v) EXPECT_EQ(row_of(map, v), "...EEEEEE...");
}

TEST(DepthEdges, ASmallStepIsNone) {
  DepthMap map = step_map(12, 5, 6, 1.03F);  // 0.029 1/m
  mark_depth_edges(&map, {});
  EXPECT_EQ(row_of(map, 2), "............");
}

TEST(DepthEdges, AStepIsSeenAcrossAHole) {
  DepthMap map = step_map(12, 1, 6, 1.5F);
  for (const std::size_t hole : {5u, 6u, 7u}) map.state[hole] = DepthState::kInvalid;
  mark_depth_edges(&map, {.radius_px = 1});
  EXPECT_EQ(row_of(map, 0), "...EE   EE..");
}

TEST(DepthEdges, ASlantedPlaneWithAHoleIsNone) {
  DepthMap map = step_map(20, 1, 20, 1.0F);
  for (int u = 0; u < 20; ++u) map.depth_m[static_cast<std::size_t>(u)] = 1 / (1.0F + 0.01F * static_cast<float>(u));
  for (std::size_t u = 5; u < 15; ++u) map.state[u] = DepthState::kInvalid;
  mark_depth_edges(&map, {});
  EXPECT_EQ(row_of(map, 0), ".....          .....");
}

TEST(DepthEdges, ARadiusLargerThanTheImageIsHarmless) {
  DepthMap map = step_map(4, 3, 2, 2.0F);
  mark_depth_edges(&map, {.radius_px = 50});
  for (int v = 0; v < 3; ++v) EXPECT_EQ(row_of(map, v), "EEEE");
}

}  // namespace
}  // namespace vantage
