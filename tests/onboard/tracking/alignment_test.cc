#include <algorithm>
#include <random>

#include <gtest/gtest.h>

#include "onboard/tracking/corner_detector.h"
#include "onboard/tracking/image_pyramid.h"
#include "onboard/tracking/patch_alignment.h"
#include "onboard/tracking/rotation_alignment.h"
#include "onboard/tracking/sparse_alignment.h"
#include "tests/onboard/tracking/textured_scene.h"

namespace vantage::tracking {
namespace {

/// A smooth picture, moved and relit, whose value at any place is known.
GreyImage picture(double du, double dv, double gain, double offset) {
  constexpr int kSide = 64;
  auto pixels = std::make_shared<std::vector<std::uint8_t>>(kSide * kSide);
  for (int v = 0; v < kSide; ++v) {
    for (int u = 0; u < kSide; ++u) {
      const double grey = 60 + 120 * lattice_noise((u - du) / 7.0, (v - dv) / 7.0, 5);
      (*pixels)[static_cast<std::size_t>(v * kSide + u)] =
          static_cast<std::uint8_t>(std::lround(std::min(255.0, gain * grey + offset)));
    }
  }
  GreyImage image;
  image.width = image.height = kSide;
  image.stride = kSide;
  image.pixels = {pixels, pixels->data()};
  return image;
}

TEST(PatchAlignment, RecoversKnownShiftsTo005PixelsInAnyLight) {
  constexpr unsigned kSeed = 11;
  SCOPED_TRACE("seed " + std::to_string(kSeed));
  std::mt19937 random(kSeed);
  std::uniform_real_distribution<double> shift(-2, 2), light(0.7, 1.3), offset(-10, 10);
  ImagePyramid reference;
  reference.build(picture(0, 0, 1, 0));
  std::vector<double> errors;
  for (int i = 0; i < 600; ++i) {
    const double du = shift(random), dv = shift(random);
    ImagePyramid current;
    current.build(picture(du, dv, light(random), offset(random)));
    const Eigen::Vector2d at(20 + i % 23, 20 + i % 19);
    BorderedPatch patch;
    ASSERT_TRUE(cut_patch(reference.level(0), at, &patch));
    const PatchAlignment found = align_patch(current.level(0), patch, at, nullptr, 30);
    // Corners, as the detector would take them: elsewhere a patch may be flat in one direction.
    if (shi_tomasi_score(reference.level(0), static_cast<int>(at.x()), static_cast<int>(at.y())) < 30) continue;
    EXPECT_TRUE(found.converged);
    EXPECT_GT(found.correlation, 0.97);
    errors.push_back((found.pixel - at - Eigen::Vector2d(du, dv)).norm());
  }
  ASSERT_GE(errors.size(), 100U);
  double square = 0;
  for (const double error : errors) square += error * error / static_cast<double>(errors.size());
  EXPECT_LT(std::sqrt(square), 0.05);
  EXPECT_LT(*std::max_element(errors.begin(), errors.end()), 0.12);
}

TEST(PatchAlignment, AnEdgeletIsFoundAcrossItsEdge) {
  // A straight edge at 30 degrees: along it nothing is to be seen, across it the place is known.
  const Eigen::Vector2d normal(std::cos(0.52), std::sin(0.52));
  const auto edge = [&](double moved) {
    auto pixels = std::make_shared<std::vector<std::uint8_t>>(64 * 64);
    for (int v = 0; v < 64; ++v) {
      for (int u = 0; u < 64; ++u) {
        const double across = normal.dot(Eigen::Vector2d(u - 32, v - 32)) - moved;
        (*pixels)[static_cast<std::size_t>(v * 64 + u)] =
            static_cast<std::uint8_t>(std::lround(120 + 80 * std::tanh(across / 2)));
      }
    }
    GreyImage image;
    image.width = image.height = 64;
    image.stride = 64;
    image.pixels = {pixels, pixels->data()};
    return image;
  };
  ImagePyramid reference, current;
  reference.build(edge(0));
  current.build(edge(1.3));
  BorderedPatch patch;
  ASSERT_TRUE(cut_patch(reference.level(0), {32, 32}, &patch));
  const PatchAlignment found = align_patch(current.level(0), patch, {32, 32}, &normal, 30);
  ASSERT_TRUE(found.converged);
  EXPECT_NEAR(normal.dot(found.pixel - Eigen::Vector2d(32, 32)), 1.3, 0.05);
  EXPECT_NEAR((found.pixel - Eigen::Vector2d(32, 32)).norm(), 1.3, 0.05);
}

TEST(PatchAlignment, FlatPatchesAreRefused) {
  ImagePyramid flat;
  GreyImage image;
  auto pixels = std::make_shared<std::vector<std::uint8_t>>(64 * 64, std::uint8_t{90});
  image.width = image.height = 64;
  image.stride = 64;
  image.pixels = {pixels, pixels->data()};
  flat.build(image);
  BorderedPatch patch;
  ASSERT_TRUE(cut_patch(flat.level(0), {32, 32}, &patch));
  EXPECT_FALSE(align_patch(flat.level(0), patch, {32, 32}).converged);
}

TEST(ImagePyramid, CentresOfLevelsAreCarriedBothWays) {
  for (int level = 0; level < ImagePyramid::kLevels; ++level) {
    EXPECT_DOUBLE_EQ(to_base(to_level(37.25, level), level), 37.25);
  }
  EXPECT_DOUBLE_EQ(to_base(0, 1), 0.5);  // the first pixel of level 1 covers pixels 0 and 1
}

/// Points of the scene that a camera sees on a grid of pixels.
std::vector<AlignmentPoint> points_of(const CameraModel& camera, const Eigen::Isometry3d& T_world_camera) {
  std::vector<AlignmentPoint> points;
  for (int v = 24; v < camera.height - 20; v += 16) {
    for (int u = 24; u < camera.width - 20; u += 16) {
      Eigen::Vector3d ray;
      double distance = 0;
      camera.unproject({u, v}, &ray);
      TexturedScene::shade(T_world_camera.translation(), T_world_camera.linear() * ray, &distance);
      points.push_back({Eigen::Vector2d(u, v), ray * distance});
    }
  }
  return points;
}

TEST(SparseAlignment, RecoversAKnownMotionTo005PixelsThoughTheLightChanges) {
  constexpr unsigned kSeed = 3;
  SCOPED_TRACE("seed " + std::to_string(kSeed));
  std::mt19937 random(kSeed);
  std::uniform_real_distribution<double> way(-0.03, 0.03), turn(-0.03, 0.03);
  const CameraModel camera = quarter_camera();
  const Eigen::Isometry3d T_world_reference = TexturedScene::sway(0);
  ImagePyramid reference;
  reference.build(TexturedScene::render(camera, T_world_reference, 0).image);
  const std::vector<AlignmentPoint> points = points_of(camera, T_world_reference);
  SparseAlignment alignment(camera);
  for (int i = 0; i < 8; ++i) {
    Vector6d xi;
    xi << way(random), way(random), way(random), turn(random), turn(random), turn(random);
    const Eigen::Isometry3d T_current_reference = motion_exp(xi);
    ImagePyramid current;
    current.build(TexturedScene::render(camera, T_world_reference * T_current_reference.inverse(),
                                        static_cast<std::uint64_t>(i + 1), 1, i % 2 == 0 ? 1.15 : 0.75)
                      .image);
    AlignmentOptions options;
    options.finest_level = 0;
    options.iterations = 20;
    const AlignmentResult result =
        alignment.align(reference, points, current, Eigen::Isometry3d::Identity(), {}, options);
    double sum = 0;
    int count = 0;
    for (const AlignmentPoint& p : points) {
      Eigen::Vector2d found, truth;
      if (!camera.project(result.T_current_reference * p.point, &found)) continue;
      ASSERT_TRUE(camera.project(T_current_reference * p.point, &truth));
      if (!camera.contains(truth)) continue;
      sum += (found - truth).norm();
      ++count;
    }
    EXPECT_LT(sum / count, 0.05) << "motion " << xi.transpose();
    EXPECT_NEAR(result.gain, i % 2 == 0 ? 1.15 : 0.75, 0.03);
  }
}

TEST(SparseAlignment, AStrongPriorHoldsWhereTheImageSaysNothing) {
  const CameraModel camera = quarter_camera();
  const Eigen::Isometry3d T = TexturedScene::sway(0);
  ImagePyramid reference, dark;
  reference.build(TexturedScene::render(camera, T, 0).image);
  dark.build(TexturedScene::covered(camera, 1).image);
  SparseAlignment alignment(camera);
  MotionPrior prior;
  prior.T_current_reference.translation() = Eigen::Vector3d(0.01, 0, 0);
  prior.sigma_translation_m = 1e-4;
  prior.sigma_rotation_rad = 1e-4;
  const AlignmentResult result =
      alignment.align(reference, points_of(camera, T), dark, prior.T_current_reference, prior);
  EXPECT_LT(motion_log(result.T_current_reference * prior.T_current_reference.inverse()).norm(), 2e-3);
}

TEST(RotationAlignment, RecoversATurnOfFiveDegrees) {
  const CameraModel camera = quarter_camera();
  const Eigen::Isometry3d T_world_reference = TexturedScene::sway(0);
  RotationAlignment alignment(camera);
  ImagePyramid reference;
  reference.build(TexturedScene::render(camera, T_world_reference, 0).image);
  for (const Eigen::Vector3d& omega : {Eigen::Vector3d(0, 0.087, 0), Eigen::Vector3d(0.06, -0.05, 0.03)}) {
    const Eigen::Matrix3d R_current_reference = rotation_exp(omega).toRotationMatrix();
    Eigen::Isometry3d T_world_current = T_world_reference;
    T_world_current.linear() = T_world_reference.linear() * R_current_reference.transpose();
    ImagePyramid current;
    current.build(TexturedScene::render(camera, T_world_current, 1).image);
    const auto result = alignment.align(reference, current);
    const Eigen::Quaterniond error(Eigen::Matrix3d(result.R_current_reference * R_current_reference.transpose()));
    EXPECT_LT(rotation_log(error).norm(), 0.016) << "a quarter of a pixel of the small image";
    EXPECT_GT(result.correlation, 0.9);
  }
}

}  // namespace
}  // namespace vantage::tracking
