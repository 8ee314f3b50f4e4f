#include "onboard/depth/pose_refinement.h"

#include <cmath>
#include <numbers>
#include <random>

#include <gtest/gtest.h>

#include "tests/allocation_watch.h"
#include "tests/onboard/depth/malloc_watch.h"
#include "tests/onboard/depth/plane_scene.h"

namespace vantage {
namespace {

using Matrix6d = Eigen::Matrix<double, 6, 6>;

constexpr double kDegree = std::numbers::pi / 180;

/// A wall that falls away to one side and two boards before it, seen by a camera that hovers.
class Hover {
 public:
  Hover() {
    scene_.rectangles = {{.z = 1.2, .grain_m = 0.03, .slope = 0.2, .seed = 1},
                         {.z = 0.7, .centre = {-0.1, 0}, .half = {0.12, 0.1}, .grain_m = 0.02, .seed = 2},
                         {.z = 0.9, .centre = {0.2, -0.1}, .half = {0.1, 0.15}, .grain_m = 0.02, .seed = 3}};
  }
  static Eigen::Isometry3d pose(int i) {
    return camera_at(0.04 * std::sin(0.35 * i), 0.04 * std::sin(0.23 * i), 0.01 * std::sin(0.19 * i),
                     0.017 * std::sin(0.27 * i));
  }
  GreyImage image(int i) const { return photograph(scene_, camera, pose(i), static_cast<std::uint64_t>(i + 1)); }

  CameraModel camera = small_camera();

 private:
  PlaneScene scene_;
};

Matrix6d covariance_of(double shift_m, double turn_rad) {
  Matrix6d covariance = Matrix6d::Zero();
  covariance.diagonal().head<3>().setConstant(shift_m * shift_m);
  covariance.diagonal().tail<3>().setConstant(turn_rad * turn_rad);
  return covariance;
}

/// One key frame's refinement, frame by frame, from poses with noise.
class Flight {
 public:
  Flight(double stated_shift_m, double stated_turn_rad, unsigned seed)
      : stated_(covariance_of(stated_shift_m, stated_turn_rad)), random_(seed) {
    options_.min_depth_m = 0.4;
    options_.max_depth_m = 4;
    prior_.assign(static_cast<std::size_t>(hover_.camera.width * hover_.camera.height),
                  PixelBelief{.mean = 1.4F, .variance = 0.3F, .inliers = 5, .outliers = 5});
    refinement_ = std::make_unique<PoseRefinement>(hover_.camera, options_, &pool_);
  }

  void begin(double shift_m, double turn_rad) {
    key_ = noisy(Hover::pose(0), shift_m, turn_rad);
    refinement_->begin(hover_.image(0), stated_, prior_, 0);
  }

  /// Frame i with noise of these sigmas.
  void fly(int i, double shift_m, double turn_rad) {
    given_ = noisy(Hover::pose(i), shift_m, turn_rad).inverse() * key_;
    truth_ = Hover::pose(i).inverse() * Hover::pose(0);
    refined_ = refinement_->refine(hover_.image(i), given_, stated_);
  }

  const Hover& hover() const { return hover_; }
  PoseRefinement& refinement() { return *refinement_; }
  const RefinedPose& refined() const { return refined_; }
  const Eigen::Isometry3d& given() const { return given_; }
  const Eigen::Isometry3d& truth() const { return truth_; }
  const Matrix6d& stated() const { return stated_; }

 private:
  Eigen::Isometry3d noisy(Eigen::Isometry3d pose, double shift_m, double turn_rad) {
    for (int k = 0; k < 3; ++k) {
      pose.translation()(k) += shift_m * normal_(random_);
      Eigen::Vector3d axis = Eigen::Vector3d::Unit(k);
      pose.linear() = pose.linear() * Eigen::AngleAxisd(turn_rad * normal_(random_), axis).toRotationMatrix();
    }
    return pose;
  }

  Hover hover_;
  WorkerPool pool_{1};
  DepthFilterOptions options_;
  std::vector<PixelBelief> prior_;
  Matrix6d stated_;
  std::mt19937 random_;
  std::normal_distribution<double> normal_{0, 1};
  std::unique_ptr<PoseRefinement> refinement_;
  Eigen::Isometry3d key_ = Eigen::Isometry3d::Identity(), given_ = key_, truth_ = key_;
  RefinedPose refined_;
};

TEST(PoseRefinementTest, ExactPosesStayAsGivenHoweverLittleIsStated) {
  for (const double stated_m : {0.001, 0.005}) {
    SCOPED_TRACE(testing::Message() << "stated " << stated_m);
    Flight flight(stated_m, 0.05 * kDegree, 1);
    flight.begin(0, 0);
    for (int i = 1; i <= 25; ++i) {
      flight.fly(i, 0, 0);
      if (i < 8) continue;
      EXPECT_TRUE(flight.refined().has_parallax);
      EXPECT_LT((flight.refined().T_frame_key.translation() - flight.given().translation()).norm(), 1e-4);
      EXPECT_LT(Eigen::AngleAxisd(flight.refined().T_frame_key.linear() * flight.given().linear().transpose()).angle(),
                1e-4);
    }
    EXPECT_NEAR(flight.refinement().scale(), 1, 1e-3);
    EXPECT_LT(flight.refinement().scale_sigma(), 2e-3);
  }
}

TEST(PoseRefinementTest, NoisyPosesAreMended) {
  for (unsigned seed = 1; seed <= 3; ++seed) {
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    Flight flight(0.005, 0.3 * kDegree, seed);
    flight.begin(0.005, 0.3 * kDegree);
    double given = 0, mended = 0, given_turn = 0, mended_turn = 0;
    for (int i = 1; i <= 40; ++i) {
      flight.fly(i, 0.005, 0.3 * kDegree);
      if (i <= 20) continue;
      ASSERT_TRUE(flight.refined().has_parallax);
      const auto off = [&](const Eigen::Isometry3d& pose, double unit) {
        return (unit * pose.translation() - flight.truth().translation()).squaredNorm();
      };
      const auto turned = [&](const Eigen::Isometry3d& pose) {
        return std::pow(Eigen::AngleAxisd(pose.linear() * flight.truth().linear().transpose()).angle(), 2);
      };
      given += off(flight.given(), 1);
      mended += off(flight.refined().T_frame_key, flight.refinement().scale());
      given_turn += turned(flight.given());
      mended_turn += turned(flight.refined().T_frame_key);
    }
    EXPECT_LT(mended, given / 9);
    EXPECT_LT(mended_turn, given_turn / 9);
  }
}

TEST(PoseRefinementTest, TheNoiseIsJudgedWithinAFactor) {
  // Sigmas a quarter and an eighth of those stated, and the other way round.
  for (const auto& [shift, turn] : {std::pair{0.25, 0.125}, std::pair{0.125, 0.25}, std::pair{1.0, 0.25}}) {
    for (unsigned seed = 1; seed <= 3; ++seed) {
      SCOPED_TRACE(testing::Message() << "seed " << seed << ", shift " << shift << ", turn " << turn);
      Flight flight(0.008, 0.8 * kDegree, seed);
      flight.begin(0.008 * shift, 0.8 * kDegree * turn);
      for (int i = 1; i <= 30; ++i) flight.fly(i, 0.008 * shift, 0.8 * kDegree * turn);
      const PoseRefinement::Noise noise = flight.refinement().noise();
      // The key frame's own error, common to all, counts as theirs: half as much again.
      EXPECT_GT(std::sqrt(noise.shift), shift / 2);
      EXPECT_LT(std::sqrt(noise.shift), 3 * shift);
      EXPECT_GT(std::sqrt(noise.turn), turn / 2);
      EXPECT_LT(std::sqrt(noise.turn), 3 * turn);
    }
  }
}

TEST(PoseRefinementTest, TheUnitStaysWhenGoodPosesTurnBad) {
  for (unsigned seed = 1; seed <= 3; ++seed) {
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    Flight flight(0.005, 0.3 * kDegree, seed);
    flight.begin(0, 0);
    double along = 0, length = 0;
    for (int i = 1; i <= 45; ++i) {
      const bool bad = i > 15;
      flight.fly(i, bad ? 0.005 : 0, bad ? 0.3 * kDegree : 0);
      if (i <= 25) continue;
      along += flight.refined().T_frame_key.translation().dot(flight.truth().translation());
      length += flight.truth().translation().squaredNorm();
    }
    EXPECT_NEAR(along / length, 1, 0.01);
  }
}

TEST(PoseRefinementTest, AFrameTakesNothingFromTheHeap) {
  if (!AllocationWatch::works()) GTEST_SKIP() << "sanitizers replace operator new";
  for (const double noise_m : {0.0, 0.005}) {
    SCOPED_TRACE(testing::Message() << "noise " << noise_m);
    Flight flight(0.005, 0.05 * kDegree, 1);
    flight.begin(noise_m, 0);
    std::vector<GreyImage> images;
    for (int i = 1; i <= 20; ++i) images.push_back(flight.hover().image(i));
    const AllocationWatch watch;
    const MallocWatch malloc_watch;
    for (int i = 1; i <= 20; ++i) {
      const Eigen::Isometry3d given = Hover::pose(i).inverse() * Hover::pose(0);
      flight.refinement().refine(images[static_cast<std::size_t>(i - 1)], given, flight.stated());
    }
    const std::size_t taken = watch.count() + malloc_watch.count();
    EXPECT_EQ(taken, 0);
  }
}

TEST(PoseRefinementTest, TheHeapsWatchSeesEigen) {
  if (!AllocationWatch::works()) GTEST_SKIP() << "sanitizers replace malloc";
  const MallocWatch watch;
  const Eigen::VectorXd taken = Eigen::VectorXd::Zero(100);
  EXPECT_EQ(watch.count(), 1) << taken.size();
}

}  // namespace
}  // namespace vantage
