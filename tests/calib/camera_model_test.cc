#include "calib/camera_model.h"

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include <gtest/gtest.h>

namespace vantage {
namespace {

struct NamedCamera {
  const char* name;
  CameraModel camera;
};

/// EuRoC's radial-tangential and TUM-VI's equidistant coefficients: lenses that people use.
std::vector<NamedCamera> cameras() {
  return {
      {"pinhole", {752, 480, 448, 448, 375.5, 239.5, Distortion::kNone, {}}},
      {"radtan",
       {752,
        480,
        458.654,
        457.296,
        367.215,
        248.375,
        Distortion::kRadTan,
        {-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05, 0}}},
      {"equidistant",
       {512,
        512,
        190.978,
        190.973,
        254.932,
        256.897,
        Distortion::kEquidistant,
        {0.0034823894, 0.0007150348, -0.0020532361, 0.00020293673}}},
  };
}

TEST(CameraModel, UnprojectInvertsProjectOnTheWholeImage) {
  for (const auto& [name, camera] : cameras()) {
    SCOPED_TRACE(name);
    for (int v = 0; v < camera.height; v += 19) {
      for (int u = 0; u < camera.width; u += 23) {
        const Eigen::Vector2d pixel(u, v);
        Eigen::Vector3d ray;
        ASSERT_TRUE(camera.unproject(pixel, &ray)) << pixel.transpose();
        EXPECT_NEAR(ray.norm(), 1, 1e-12);
        Eigen::Vector2d again;
        ASSERT_TRUE(camera.project(3.7 * ray, &again));
        EXPECT_LT((again - pixel).norm(), 1e-8) << pixel.transpose();
      }
    }
  }
}

TEST(CameraModel, JacobiansEqualNumericOnes) {
  const unsigned seed = 7;
  RecordProperty("seed", static_cast<int>(seed));
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> inside(0.05, 0.95), depth(0.3, 5);
  const double step = 1e-6;
  for (const auto& [name, camera] : cameras()) {
    SCOPED_TRACE(name);
    for (int trial = 0; trial < 200; ++trial) {
      const Eigen::Vector2d pixel(inside(random) * camera.width, inside(random) * camera.height);
      Eigen::Vector3d ray;
      Eigen::Matrix<double, 3, 2> d_ray;
      ASSERT_TRUE(camera.unproject(pixel, &ray, &d_ray));
      for (int k = 0; k < 2; ++k) {
        Eigen::Vector3d plus, minus;
        ASSERT_TRUE(camera.unproject(pixel + step * Eigen::Vector2d::Unit(k), &plus));
        ASSERT_TRUE(camera.unproject(pixel - step * Eigen::Vector2d::Unit(k), &minus));
        EXPECT_LT((d_ray.col(k) - (plus - minus) / (2 * step)).norm(), 1e-8);
      }
      const Eigen::Vector3d point = depth(random) * ray;
      Eigen::Vector2d at;
      Eigen::Matrix<double, 2, 3> d_pixel;
      ASSERT_TRUE(camera.project(point, &at, &d_pixel));
      for (int k = 0; k < 3; ++k) {
        Eigen::Vector2d plus, minus;
        ASSERT_TRUE(camera.project(point + step * Eigen::Vector3d::Unit(k), &plus));
        ASSERT_TRUE(camera.project(point - step * Eigen::Vector3d::Unit(k), &minus));
        EXPECT_LT((d_pixel.col(k) - (plus - minus) / (2 * step)).norm(), 1e-4 * std::max(1.0, d_pixel.norm()));
      }
    }
  }
}

TEST(CameraModel, PinholeFollowsTheHandCalculation) {
  const CameraModel camera{640, 480, 500, 400, 320, 240, Distortion::kNone, {}};
  Eigen::Vector2d pixel;
  ASSERT_TRUE(camera.project({0.2, -0.1, 2}, &pixel));
  EXPECT_DOUBLE_EQ(pixel.x(), 320 + 500 * 0.1);
  EXPECT_DOUBLE_EQ(pixel.y(), 240 - 400 * 0.05);
}

TEST(CameraModel, EquidistantWithoutCoefficientsIsProportionalToTheAngle) {
  const CameraModel camera{512, 512, 200, 200, 256, 256, Distortion::kEquidistant, {}};
  for (const double angle : {0.0, 1e-12, 0.3, 1.0, M_PI / 2, 2.0}) {
    Eigen::Vector2d pixel;
    ASSERT_TRUE(camera.project({std::sin(angle), 0, std::cos(angle)}, &pixel));
    EXPECT_NEAR(pixel.x(), 256 + 200 * angle, 1e-9) << angle;
    EXPECT_NEAR(pixel.y(), 256, 1e-9);
  }
}

TEST(CameraModel, RefusesWhatItCannotSee) {
  Eigen::Vector2d pixel(-1, -1);
  for (const auto& [name, camera] : cameras()) {
    SCOPED_TRACE(name);
    EXPECT_FALSE(camera.project({0, 0, 0}, &pixel));
    EXPECT_FALSE(camera.project({0, 0, -1}, &pixel));
    EXPECT_FALSE(camera.project({std::nan(""), 0, 1}, &pixel));
    Eigen::Vector3d ray;
    EXPECT_FALSE(camera.unproject({std::nan(""), 0}, &ray));
  }
  EXPECT_EQ(pixel, Eigen::Vector2d(-1, -1));
}

TEST(CameraModel, RefusesAnglesBeyondTheRadialPolynomialsTurn) {
  CameraModel camera{640, 480, 500, 500, 320, 240, Distortion::kRadTan, {-0.3}};
  // r (1 - 0.3 r^2) turns at r = 1 / sqrt(0.9) = 1.054.
  Eigen::Vector2d pixel;
  EXPECT_TRUE(camera.project({1.0, 0, 1}, &pixel));
  EXPECT_FALSE(camera.project({1.1, 0, 1}, &pixel));
}

TEST(CameraModel, ValidNamesTheFault) {
  CameraModel camera = cameras()[0].camera;
  EXPECT_TRUE(camera.valid());
  std::string why;
  camera.fx = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(camera.valid(&why));
  EXPECT_NE(why.find("fx"), std::string::npos);
  camera = cameras()[0].camera;
  camera.width = 0;
  EXPECT_FALSE(camera.valid(&why));
  EXPECT_NE(why.find("width"), std::string::npos);
}

}  // namespace
}  // namespace vantage
