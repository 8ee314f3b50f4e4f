#include "onboard/depth/window_adjustment.h"

#include <random>

#include <gtest/gtest.h>

#include "tests/onboard/depth/plane_scene.h"

namespace vantage {
namespace {

using Vector6d = Eigen::Matrix<double, 6, 1>;

/// Corners at random depths, seen from some poses without noise: the optimum is known.
struct Problem {
  CameraModel camera = small_camera();
  std::vector<AdjustedCorner> truth, corners;
  std::vector<AdjustedView> true_views, views;

  explicit Problem(unsigned seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> inverse(0.4, 2.0), pixel_x(10, 150), pixel_y(10, 110);
    std::normal_distribution<double> normal(0, 1);
    for (int k = 0; k < 80; ++k) {
      const Eigen::Vector3d ray((pixel_x(random) - camera.cx) / camera.fx, (pixel_y(random) - camera.cy) / camera.fy,
                                1);
      truth.push_back({.ray = ray, .inverse = inverse(random), .prior_mean = 1.2, .prior_sigma = 1});
    }
    corners = truth;
    for (AdjustedCorner& corner : corners) corner.inverse = 1.2;
    for (int i = 0; i < 5; ++i) {
      AdjustedView view;
      view.T = camera_at(0.05 * normal(random), 0.05 * normal(random), 0.02 * normal(random), 0.02 * normal(random));
      for (const AdjustedCorner& corner : truth) {
        const Eigen::Vector3d P = view.T.linear() * corner.ray + corner.inverse * view.T.translation();
        PatchPlace place;
        place.position =
            Eigen::Vector2d(camera.fx * P.x() / P.z() + camera.cx, camera.fy * P.y() / P.z() + camera.cy).cast<float>();
        place.found = true;
        view.places.push_back(place);
      }
      view.prior = view.T;
      // The first view holds the scale; the others' priors are a millimetre and a milliradian.
      view.information.diagonal().setConstant(i == 0 ? 1e12 : 1e6);
      true_views.push_back(view);
      Vector6d off;
      for (int k = 0; k < 6; ++k) off(k) = (i == 0 ? 0 : 0.004) * normal(random);
      view.T = moved(view.T, off);
      view.information *= i == 0 ? 1 : 1e-2;
      views.push_back(view);
    }
  }

  std::vector<AdjustedView*> pointers() {
    std::vector<AdjustedView*> all;
    for (AdjustedView& view : views) all.push_back(&view);
    return all;
  }
};

TEST(WindowAdjustmentTest, ReachesTheKnownOptimum) {
  for (const unsigned seed : {1U, 2U, 3U}) {
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    Problem problem(seed);
    WindowAdjustment adjustment(problem.camera, 0.05, 5);
    auto views = problem.pointers();
    adjustment.run(views, problem.corners, 0.1, 60);
    for (std::size_t i = 0; i < views.size(); ++i) {
      EXPECT_LT((views[i]->T.translation() - problem.true_views[i].T.translation()).norm(), 3e-4);
      EXPECT_LT(Eigen::AngleAxisd(views[i]->T.linear().transpose() * problem.true_views[i].T.linear()).angle(), 3e-4);
    }
    EXPECT_LT(adjustment.residual_sigma(views, problem.corners), 0.02);
    for (std::size_t k = 0; k < problem.corners.size(); ++k) {
      EXPECT_NEAR(problem.corners[k].inverse, problem.truth[k].inverse, 0.02);
    }
  }
}

TEST(WindowAdjustmentTest, WrongPlacesPullLittle) {
  Problem problem(4);
  for (AdjustedView& view : problem.views) {
    for (std::size_t k = 0; k < view.places.size(); k += 10) view.places[k].position += Eigen::Vector2f(15, -9);
  }
  WindowAdjustment adjustment(problem.camera, 0.05, 5);
  auto views = problem.pointers();
  adjustment.run(views, problem.corners, 0.1, 60);
  for (std::size_t i = 0; i < views.size(); ++i) {
    EXPECT_LT((views[i]->T.translation() - problem.true_views[i].T.translation()).norm(), 2e-3);
  }
}

TEST(WindowAdjustmentTest, NeverRaisesTheCost) {
  Problem problem(5);
  WindowAdjustment adjustment(problem.camera, 0.05, 5);
  auto views = problem.pointers();
  double last = std::numeric_limits<double>::infinity();
  for (int i = 0; i < 12; ++i) {
    const double cost = adjustment.run(views, problem.corners, 0.1, 1);
    EXPECT_LE(cost, last * (1 + 1e-12));
    last = cost;
  }
}

TEST(WindowAdjustmentTest, EvidenceNamesThePriorsErrors) {
  // Places without noise: where the priors err by e, H e + g = 0, wherever the adjustment ended.
  for (const double narrow : {1.0, 1e6}) {
    Problem problem(7);
    WindowAdjustment adjustment(problem.camera, 0.05, 5);
    std::mt19937 random(7);
    std::normal_distribution<double> normal(0, 1e-4);
    Eigen::VectorXd error(30);
    for (std::size_t i = 0; i < problem.views.size(); ++i) {
      Vector6d off;
      for (int k = 0; k < 6; ++k) off(k) = normal(random);
      problem.views[i].information = narrow * 1e4 * Eigen::Matrix<double, 6, 6>::Identity();
      problem.views[i].T = problem.views[i].prior = moved(problem.true_views[i].T, off);
      error.segment<6>(static_cast<Eigen::Index>(6 * i)) = -off;
    }
    problem.corners = problem.truth;
    for (AdjustedCorner& corner : problem.corners) {
      corner.prior_sigma = 1e3;
      corner.inverse += 0.01;
    }
    auto views = problem.pointers();
    adjustment.run(views, problem.corners, 0.1, 20);
    PoseEvidence evidence;
    adjustment.weigh(views, &evidence);
    const Eigen::VectorXd left = evidence.images * error + evidence.gradient;
    EXPECT_LT(left.norm(), 0.02 * evidence.gradient.norm()) << narrow;
  }
}

TEST(WindowAdjustmentTest, CovarianceIsTheSpreadOfTheLastPose) {
  // Places with noise of 0.2 px, many times: the last pose's spread against what is stated.
  Problem clean(6);
  std::mt19937 random(6);
  std::normal_distribution<double> normal(0, 0.2);
  Eigen::Matrix<double, 6, 6> spread = Eigen::Matrix<double, 6, 6>::Zero(), stated = spread;
  constexpr int kTrials = 60;
  for (int trial = 0; trial < kTrials; ++trial) {
    Problem problem(6);
    problem.views = clean.true_views;
    problem.corners = clean.truth;
    for (AdjustedView& view : problem.views) {
      for (PatchPlace& place : view.places) {
        place.position += Eigen::Vector2d(normal(random), normal(random)).cast<float>();
      }
      // Noise of the priors, as stated.
      Vector6d off;
      for (int k = 0; k < 6; ++k) off(k) = normal(random) / 0.2 / std::sqrt(view.information(k, k));
      view.prior = moved(view.prior, off);
    }
    WindowAdjustment adjustment(problem.camera, 0.05, 5);
    auto views = problem.pointers();
    adjustment.run(views, problem.corners, 0.2, 20);
    stated = adjustment.last_covariance();
    const Eigen::Isometry3d step = views.back()->T * clean.true_views.back().T.inverse();
    const Eigen::AngleAxisd turn(step.linear());
    Vector6d d;
    d << step.translation(), turn.angle() * turn.axis();
    spread += d * d.transpose() / kTrials;
  }
  for (int k = 0; k < 6; ++k) {
    EXPECT_GT(spread(k, k), 0.4 * stated(k, k)) << k;
    EXPECT_LT(spread(k, k), 2.5 * stated(k, k)) << k;
  }
}

}  // namespace
}  // namespace vantage
