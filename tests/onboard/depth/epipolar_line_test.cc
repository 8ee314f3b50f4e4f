#include "onboard/depth/epipolar_line.h"

#include <random>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "calib/camera_model.h"

namespace vantage {
namespace {

const CameraModel kCamera{.width = 640, .height = 480, .fx = 460, .fy = 455, .cx = 319, .cy = 241, .coefficients = {}};

PairGeometry pair(const Eigen::Isometry3d& T) {
  PairGeometry g;
  g.fx = static_cast<float>(kCamera.fx);
  g.fy = static_cast<float>(kCamera.fy);
  g.cx = static_cast<float>(kCamera.cx);
  g.cy = static_cast<float>(kCamera.cy);
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) g.rotation[3 * i + k] = static_cast<float>(T.linear()(i, k));
    g.translation[i] = static_cast<float>(T.translation()(i));
  }
  return g;
}

Eigen::Vector2d seen(const Eigen::Isometry3d& T, const Eigen::Vector2d& pixel, double inverse) {
  const Eigen::Vector3d ray((pixel.x() - kCamera.cx) / kCamera.fx, (pixel.y() - kCamera.cy) / kCamera.fy, 1);
  Eigen::Vector2d place;
  EXPECT_TRUE(kCamera.project(T * (ray / inverse), &place));
  return place;
}

Eigen::Isometry3d small_motion(std::mt19937& random) {
  std::normal_distribution<double> normal(0, 1);
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation() = 0.05 * Eigen::Vector3d(normal(random), normal(random), normal(random));
  const Eigen::Vector3d turn = 0.05 * Eigen::Vector3d(normal(random), normal(random), normal(random));
  T.linear() = Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix();
  return T;
}

class EpipolarLineTest : public testing::Test {
 protected:
  std::mt19937 random_{11};
};

TEST_F(EpipolarLineTest, PlacesEveryInverseDepthWhereTheCameraSeesIt) {
  for (int i = 0; i < 100; ++i) {
    const Eigen::Isometry3d T = small_motion(random_);
    const Eigen::Vector2d pixel(100 + 4 * i, 400 - 3 * i);
    EpipolarLine line;
    ASSERT_TRUE(epipolar_line(pair(T), static_cast<float>(pixel.x()), static_cast<float>(pixel.y()), 1.2F, &line));
    for (const double inverse : {0.2, 0.9, 1.2, 2.5}) {
      const Eigen::Vector2d truth = seen(T, pixel, inverse);
      const float s = line.along(static_cast<float>(inverse));
      EXPECT_NEAR(line.u0 + s * line.ex, truth.x(), 2e-3);
      EXPECT_NEAR(line.v0 + s * line.ey, truth.y(), 2e-3);
      EXPECT_NEAR(line.inverse_depth(s), inverse, 2e-3);
    }
    const double h = 1e-4;
    EXPECT_NEAR(line.slope(), (seen(T, pixel, 1.2 + h) - seen(T, pixel, 1.2 - h)).norm() / (2 * h),
                1e-3 * line.slope() + 1e-3);
  }
}

TEST_F(EpipolarLineTest, BendsThePatchAsAPlaneThatFacesTheKeyCamera) {
  const Eigen::Isometry3d T = small_motion(random_);
  const Eigen::Vector2d pixel(250, 300);
  EpipolarLine line;
  ASSERT_TRUE(epipolar_line(pair(T), 250, 300, 0.8F, &line));
  Eigen::Matrix2d to_frame;
  const double h = 0.5;
  to_frame.col(0) =
      (seen(T, pixel + h * Eigen::Vector2d::UnitX(), 0.8) - seen(T, pixel - h * Eigen::Vector2d::UnitX(), 0.8)) /
      (2 * h);
  to_frame.col(1) =
      (seen(T, pixel + h * Eigen::Vector2d::UnitY(), 0.8) - seen(T, pixel - h * Eigen::Vector2d::UnitY(), 0.8)) /
      (2 * h);
  const Eigen::Matrix2d to_key = to_frame.inverse();
  EXPECT_NEAR(line.to_key[0], to_key(0, 0), 1e-4);
  EXPECT_NEAR(line.to_key[1], to_key(0, 1), 1e-4);
  EXPECT_NEAR(line.to_key[2], to_key(1, 0), 1e-4);
  EXPECT_NEAR(line.to_key[3], to_key(1, 1), 1e-4);
}

TEST_F(EpipolarLineTest, CarriesThePosesCovarianceToThePixel) {
  // Against samples of poses: shift 3 mm, turn 1 mrad, correlated.
  const Eigen::Isometry3d T = small_motion(random_);
  Eigen::Matrix<double, 6, 6> root = Eigen::Matrix<double, 6, 6>::Zero();
  root.topLeftCorner<3, 3>().diagonal().setConstant(0.003);
  root.bottomRightCorner<3, 3>().diagonal().setConstant(0.001);
  root(4, 0) = 0.0008;
  const Eigen::Matrix<double, 6, 6> covariance = root * root.transpose();
  PairGeometry g = pair(T);
  for (int i = 0; i < 6; ++i) {
    for (int k = 0; k < 6; ++k) g.covariance[6 * i + k] = static_cast<float>(covariance(i, k));
  }
  const Eigen::Vector2d pixel(420, 130);
  const double inverse = 1.1;
  EpipolarLine line;
  ASSERT_TRUE(epipolar_line(g, 420, 130, static_cast<float>(inverse), &line));
  std::normal_distribution<double> normal(0, 1);
  double along = 0, across = 0;
  constexpr int kSamples = 20000;
  for (int i = 0; i < kSamples; ++i) {
    Eigen::Matrix<double, 6, 1> white;
    for (int k = 0; k < 6; ++k) white(k) = normal(random_);
    const Eigen::Matrix<double, 6, 1> d = root * white;
    Eigen::Isometry3d step = Eigen::Isometry3d::Identity();
    step.linear() = Eigen::AngleAxisd(d.tail<3>().norm(), d.tail<3>().normalized()).toRotationMatrix();
    step.translation() = d.head<3>();
    const Eigen::Vector2d off = seen(step * T, pixel, inverse) - Eigen::Vector2d(line.u0, line.v0);
    const double a = off.x() * line.ex + off.y() * line.ey, c = off.y() * line.ex - off.x() * line.ey;
    along += a * a / kSamples;
    across += c * c / kSamples;
  }
  EXPECT_NEAR(line.variance_along_px2, along, 0.05 * along);
  EXPECT_NEAR(line.variance_across_px2, across, 0.05 * across);
}

TEST_F(EpipolarLineTest, WithoutParallaxHasNoLength) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitY()).toRotationMatrix();
  EpipolarLine line;
  ASSERT_TRUE(epipolar_line(pair(T), 300, 200, 1, &line));
  EXPECT_EQ(line.slope(), 0);
}

TEST_F(EpipolarLineTest, RefusesWhatIsBehindTheCamera) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation().z() = -2;
  EpipolarLine line;
  EXPECT_FALSE(epipolar_line(pair(T), 300, 200, 1, &line));
}

}  // namespace
}  // namespace vantage
