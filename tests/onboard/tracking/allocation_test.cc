// The tracker's inner loops take no memory once they have run.

#include <gtest/gtest.h>

#include "onboard/tracking/map_search.h"
#include "onboard/tracking/rotation_alignment.h"
#include "onboard/tracking/sparse_alignment.h"
#include "tests/allocation_watch.h"
#include "tests/onboard/tracking/textured_scene.h"

namespace vantage::tracking {
namespace {

TEST(InnerLoops, AllocateNothingAfterTheFirstFrame) {
  if (!AllocationWatch::works()) GTEST_SKIP() << "sanitizers replace operator new";
  const CameraModel camera = quarter_camera();
  const Eigen::Isometry3d T_world_first = TexturedScene::sway(0), T_world_second = TexturedScene::sway(0.1);
  auto first = std::make_shared<ImagePyramid>();
  first->build(TexturedScene::render(camera, T_world_first, 0).image);
  ImagePyramid second;
  const Frame second_frame = TexturedScene::render(camera, T_world_second, 1);
  second.build(second_frame.image);

  Map map;
  KeyFrame key_frame;
  key_frame.image = first;
  key_frame.T_camera_world = T_world_first.inverse();
  const KeyFrameId host = map.add_key_frame(key_frame).id;
  std::vector<AlignmentPoint> points;
  for (int v = 30; v < 210; v += 15) {
    for (int u = 30; u < 290; u += 15) {
      Landmark landmark;
      landmark.host = host;
      landmark.pixel = {u, v};
      double distance = 0;
      camera.unproject({u, v}, &landmark.ray);
      TexturedScene::shade(T_world_first.translation(), T_world_first.linear() * landmark.ray, &distance);
      landmark.position = T_world_first * (landmark.ray * distance);
      landmark.converged = true;
      points.push_back({landmark.pixel, landmark.ray * distance});
      map.add_landmark(landmark);
    }
  }
  SparseAlignment sparse(camera);
  RotationAlignment rotation(camera);
  MapSearch search(camera);
  MapMatches matches;
  const std::vector<KeyFrameId> local{host};
  const auto frame = [&] {
    second.build(second_frame.image);
    rotation.align(*first, second);
    const AlignmentResult aligned = sparse.align(*first, points, second, Eigen::Isometry3d::Identity());
    Eigen::Isometry3d T = aligned.T_current_reference * T_world_first.inverse();
    search.run(&map, local, second, T, &matches);
    return refine_pose(camera, matches.measurements, std::nullopt, &T).inliers;
  };
  const int inliers = frame();
  EXPECT_GT(inliers, 50);
  const AllocationWatch watch;
  EXPECT_EQ(frame(), inliers);
  EXPECT_EQ(watch.count(), 0U);
}

}  // namespace
}  // namespace vantage::tracking
