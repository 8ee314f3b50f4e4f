#include <random>

#include <gtest/gtest.h>

#include "onboard/tracking/bundle_adjustment.h"
#include "onboard/tracking/depth_belief.h"
#include "onboard/tracking/pose_graph.h"
#include "onboard/tracking/pose_refinement.h"
#include "onboard/tracking/rigid_motion.h"
#include "onboard/tracking/similarity.h"
#include "onboard/tracking/trajectory_error.h"
#include "tests/onboard/tracking/textured_scene.h"

namespace vantage::tracking {
namespace {

constexpr unsigned kSeed = 42;

Vector6d random_motion(std::mt19937* random, double way, double turn) {
  std::uniform_real_distribution<double> unit(-1, 1);
  Vector6d xi;
  for (int i = 0; i < 6; ++i) xi[i] = (i < 3 ? way : turn) * unit(*random);
  return xi;
}

TEST(RigidMotion, LogInvertsExp) {
  SCOPED_TRACE("seed " + std::to_string(kSeed));
  std::mt19937 random(kSeed);
  for (int i = 0; i < 100; ++i) {
    const Vector6d xi = random_motion(&random, 2, i < 50 ? 1.7 : 1e-7);
    EXPECT_LT((motion_log(motion_exp(xi)) - xi).norm(), 1e-12 + 1e-9 * xi.norm());
  }
}

TEST(RigidMotion, PointJacobianIsTheNumericOne) {
  const Eigen::Vector3d p(0.3, -0.2, 1.7);
  const Eigen::Matrix<double, 3, 6> jacobian = point_jacobian(p);
  for (int k = 0; k < 6; ++k) {
    const Vector6d step = 1e-6 * Vector6d::Unit(k);
    const Eigen::Vector3d numeric = (motion_exp(step) * p - motion_exp(-step) * p) / 2e-6;
    EXPECT_LT((jacobian.col(k) - numeric).norm(), 1e-8);
  }
}

TEST(PosePrior, JacobianIsTheNumericOne) {
  SCOPED_TRACE("seed " + std::to_string(kSeed));
  std::mt19937 random(kSeed);
  for (int i = 0; i < 20; ++i) {
    PosePrior prior;
    prior.T_world_camera = motion_exp(random_motion(&random, 1, 1));
    const Eigen::Isometry3d T = motion_exp(random_motion(&random, 0.05, 0.1)) * prior.T_world_camera.inverse();
    Vector6d residual, plus, minus;
    Matrix6d jacobian, unused;
    prior_residual(prior, T, &residual, &jacobian);
    for (int k = 0; k < 6; ++k) {
      const Vector6d step = 1e-6 * Vector6d::Unit(k);
      prior_residual(prior, motion_exp(step) * T, &plus, &unused);
      prior_residual(prior, motion_exp(-step) * T, &minus, &unused);
      const Vector6d numeric = (plus - minus) / 2e-6;
      EXPECT_LT((jacobian.col(k) - numeric).norm(), 2e-4 * (1 + numeric.norm())) << "column " << k;
    }
  }
}

/// Points in front of cameras that stand around them, and exact observations.
AdjustmentProblem exact_problem(const CameraModel& camera, int poses, int points, std::mt19937* random) {
  AdjustmentProblem problem;
  std::uniform_real_distribution<double> unit(-1, 1);
  for (int i = 0; i < poses; ++i) {
    problem.poses.push_back({motion_exp(random_motion(random, 0.2, 0.06)), i == 0, std::nullopt});
  }
  problem.poses[0].T_camera_world = Eigen::Isometry3d::Identity();
  while (static_cast<int>(problem.points.size()) < points) {
    const Eigen::Vector3d p(0.6 * unit(*random), 0.4 * unit(*random), 2 + 0.5 * unit(*random));
    std::vector<AdjustedObservation> seen;
    for (int i = 0; i < poses; ++i) {
      Eigen::Vector2d pixel;
      if (!camera.project(problem.poses[static_cast<std::size_t>(i)].T_camera_world * p, &pixel)) continue;
      AdjustedObservation o;
      o.pose = i;
      o.point = static_cast<int>(problem.points.size());
      o.pixel = pixel;
      seen.push_back(o);
    }
    problem.points.push_back(p);
    problem.observations.insert(problem.observations.end(), seen.begin(), seen.end());
  }
  problem.kept_distance = {0, 1};
  return problem;
}

TEST(BundleAdjustment, FindsTheKnownOptimum) {
  SCOPED_TRACE("seed " + std::to_string(kSeed));
  std::mt19937 random(kSeed);
  const CameraModel camera = quarter_camera();
  const AdjustmentProblem truth = exact_problem(camera, 6, 80, &random);
  AdjustmentProblem problem = truth;
  std::normal_distribution<double> normal(0, 1);
  const auto distance = [](const AdjustmentProblem& p) {
    return (p.poses[0].T_camera_world.inverse().translation() - p.poses[1].T_camera_world.inverse().translation())
        .norm();
  };
  for (std::size_t i = 1; i < problem.poses.size(); ++i) {
    problem.poses[i].T_camera_world = motion_exp(random_motion(&random, 0.02, 0.01)) * problem.poses[i].T_camera_world;
  }
  // The kept distance is that of the start: give it the truth's.
  const Eigen::Vector3d centre = problem.poses[1].T_camera_world.inverse().translation();
  problem.poses[1].T_camera_world.translation() =
      -problem.poses[1].T_camera_world.linear() * (centre * distance(truth) / centre.norm());
  for (Eigen::Vector3d& p : problem.points) p += 0.03 * Eigen::Vector3d(normal(random), normal(random), normal(random));
  const AdjustmentSummary summary = adjust(camera, &problem, {.iterations = 50, .huber = 1.5, .seconds = 0});
  ASSERT_TRUE(summary.usable);
  EXPECT_EQ(summary.outliers, 0);
  EXPECT_LT(summary.rms, 1e-3);
  for (std::size_t i = 0; i < problem.poses.size(); ++i) {
    const Vector6d error = motion_log(problem.poses[i].T_camera_world * truth.poses[i].T_camera_world.inverse());
    EXPECT_LT(error.norm(), 1e-4) << "pose " << i;
  }
  for (std::size_t i = 0; i < problem.points.size(); ++i) {
    EXPECT_LT((problem.points[i] - truth.points[i]).norm(), 1e-3) << "point " << i;
  }
}

TEST(BundleAdjustment, PriorsGiveTheScaleThatTheyState) {
  SCOPED_TRACE("seed " + std::to_string(kSeed));
  std::mt19937 random(kSeed);
  const CameraModel camera = quarter_camera();
  const AdjustmentProblem truth = exact_problem(camera, 8, 80, &random);
  AdjustmentProblem problem = truth;
  problem.kept_distance.reset();
  for (std::size_t i = 0; i < problem.poses.size(); ++i) {
    problem.poses[i].fixed = false;
    problem.poses[i].prior = PosePrior{truth.poses[i].T_camera_world.inverse(), 0.002, 0.0035};
    problem.poses[i].T_camera_world.translation() *= 1.2;  // a map that is a fifth too large
  }
  for (Eigen::Vector3d& p : problem.points) p *= 1.2;
  ASSERT_TRUE(adjust(camera, &problem, {.iterations = 50, .huber = 1.5, .seconds = 0}).usable);
  for (std::size_t i = 0; i < problem.points.size(); ++i) {
    EXPECT_LT((problem.points[i] - truth.points[i]).norm(), 2e-3) << "point " << i;
  }
}

TEST(BundleAdjustment, WrongObservationsAreNamedAndDoNotRule) {
  SCOPED_TRACE("seed " + std::to_string(kSeed));
  std::mt19937 random(kSeed);
  const CameraModel camera = quarter_camera();
  AdjustmentProblem problem = exact_problem(camera, 6, 80, &random);
  for (std::size_t i = 7; i < problem.observations.size(); i += 40) problem.observations[i].pixel.x() += 30;
  ASSERT_TRUE(adjust(camera, &problem, {.iterations = 50, .huber = 1.5, .seconds = 0}).usable);
  for (std::size_t i = 0; i < problem.observations.size(); ++i) {
    if (i % 40 == 7) {
      EXPECT_FALSE(problem.observations[i].inlier) << i;
    }
  }
}

TEST(PoseRefinement, FindsThePoseAmongAThirdOfOutliers) {
  SCOPED_TRACE("seed " + std::to_string(kSeed));
  std::mt19937 random(kSeed);
  std::uniform_real_distribution<double> unit(-1, 1);
  std::normal_distribution<double> normal(0, 0.3);
  const CameraModel camera = quarter_camera();
  const Eigen::Isometry3d truth = motion_exp(random_motion(&random, 0.3, 0.2));
  std::vector<PoseMeasurement> measurements;
  while (measurements.size() < 90) {
    const Eigen::Vector3d in_camera(0.8 * unit(random), 0.6 * unit(random), 2 + 0.7 * unit(random));
    Eigen::Vector2d pixel;
    if (!camera.project(in_camera, &pixel) || !camera.contains(pixel)) continue;
    const bool wrong = measurements.size() % 3 == 0;
    pixel +=
        wrong ? Eigen::Vector2d(40 * unit(random), 40 * unit(random)) : Eigen::Vector2d(normal(random), normal(random));
    measurements.push_back(
        {.position = truth.inverse() * in_camera, .spread = Eigen::Vector3d::Zero(), .pixel = pixel});
  }
  Eigen::Isometry3d T = motion_exp(random_motion(&random, 0.03, 0.02)) * truth;
  const RefinedPose refined = refine_pose(camera, measurements, std::nullopt, &T, 20);
  const Vector6d error = motion_log(truth * T.inverse());
  EXPECT_LT(error.head<3>().norm(), 0.005);
  EXPECT_LT(error.tail<3>().norm(), 0.003);
  EXPECT_GE(refined.inliers, 55);
  // The stated covariance is of the size of the error: chi-square of 6, its 99.9 % point is 22.
  EXPECT_LT(error.dot(refined.covariance.inverse() * error), 22);
}

TEST(PoseRefinement, APointOfUnknownDepthDoesNotMoveTheCameraAlongItsEpipolarLine) {
  // Half of the points are exact; the other half were guessed at twice their distance, and say how little they know.
  std::mt19937 random(kSeed);
  std::uniform_real_distribution<double> unit(-1, 1);
  const CameraModel camera = quarter_camera();
  Vector6d xi;
  xi << 0.1, 0, 0, 0, 0, 0;
  const Eigen::Isometry3d truth = motion_exp(xi);
  std::vector<PoseMeasurement> measurements;
  for (int i = 0; i < 80; ++i) {
    // At several depths: points of one depth alone would let the camera turn instead.
    const double z = 1.2 + 0.4 * (i / 2 % 5);
    const Eigen::Vector3d p(0.4 * z * unit(random), 0.3 * z * unit(random), z);
    Eigen::Vector2d pixel;
    ASSERT_TRUE(camera.project(truth * p, &pixel));
    PoseMeasurement m{.position = p, .spread = Eigen::Vector3d::Zero(), .pixel = pixel};
    if (i % 2 == 0) {
      m.position = 2 * p;
      m.spread = 2 * p;
    }
    measurements.push_back(m);
  }
  Eigen::Isometry3d knowing = Eigen::Isometry3d::Identity(), believing = Eigen::Isometry3d::Identity();
  refine_pose(camera, measurements, std::nullopt, &knowing, 20);
  for (PoseMeasurement& m : measurements) m.spread.setZero();
  refine_pose(camera, measurements, std::nullopt, &believing, 20);
  // The guesses still pull, each by its one standard deviation against forty exact points: less than a tenth of the
  // way.
  EXPECT_LT(motion_log(knowing * truth.inverse()).norm(), 0.01);
  EXPECT_GT(motion_log(believing * truth.inverse()).norm(), 0.03);
}

TEST(PoseGraph, ALoopRemovesNineTenthsOfTheDrift) {
  // Sixty frames around a circle of 1 m; each step is measured with a drift of turn, way and scale.
  constexpr int kFrames = 60;
  std::vector<Similarity> truth;
  for (int i = 0; i < kFrames; ++i) {
    const double angle = 2 * M_PI * i / kFrames;
    Eigen::Isometry3d T_world_camera = Eigen::Isometry3d::Identity();
    T_world_camera.linear() = Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ()).toRotationMatrix();
    T_world_camera.translation() = Eigen::Vector3d(std::cos(angle), std::sin(angle), 0);
    truth.push_back(Similarity::from(T_world_camera.inverse()));
  }
  Vector6d step;
  step << 0.0015, -0.001, 0.001, 0.0008, -0.0006, 0.001;
  Similarity drift = Similarity::from(motion_exp(step));
  drift.scale = 1.003;
  PoseGraph graph;
  graph.nodes.push_back({truth[0], true});
  for (std::size_t i = 1; i < kFrames; ++i) {
    const Similarity S_this_last = drift * truth[i] * truth[i - 1].inverse();
    graph.edges.push_back({static_cast<int>(i), static_cast<int>(i - 1), S_this_last, 1});
    graph.nodes.push_back({S_this_last * graph.nodes[i - 1].S_camera_world, false});
  }
  const auto error_at = [&](std::size_t i) {
    return (graph.nodes[i].S_camera_world.inverse().translation - truth[i].inverse().translation).norm();
  };
  const double before = error_at(kFrames - 1);
  ASSERT_GT(before, 0.1);
  graph.edges.push_back({0, kFrames - 1, truth[0] * truth[kFrames - 1].inverse(), kFrames});
  ASSERT_TRUE(optimise(&graph, true, 50));
  EXPECT_LT(error_at(kFrames - 1), 0.1 * before);
  EXPECT_NEAR(graph.nodes.back().S_camera_world.scale, 1, 0.1 * (std::pow(1.003, kFrames) - 1));
  double worst = 0;
  for (std::size_t i = 0; i < kFrames; ++i) worst = std::max(worst, error_at(i));
  EXPECT_LT(worst, 0.5 * before) << "what is left lies in the middle of the loop";
}

TEST(Similarity, FitFindsAKnownOneAndInvertsIt) {
  SCOPED_TRACE("seed " + std::to_string(kSeed));
  std::mt19937 random(kSeed);
  std::uniform_real_distribution<double> unit(-1, 1);
  Similarity truth = Similarity::from(motion_exp(random_motion(&random, 2, 1.5)));
  truth.scale = 1.7;
  std::vector<Eigen::Vector3d> from, to;
  for (int i = 0; i < 20; ++i) {
    from.emplace_back(unit(random), unit(random), unit(random));
    to.push_back(truth * from.back());
  }
  const Similarity found = fit_similarity(from, to, true);
  EXPECT_NEAR(found.scale, 1.7, 1e-9);
  for (std::size_t i = 0; i < from.size(); ++i) {
    EXPECT_LT((found * from[i] - to[i]).norm(), 1e-9);
    EXPECT_LT((truth.inverse() * (truth * from[i]) - from[i]).norm(), 1e-12);
  }
}

TEST(DepthBelief, UpdateMatchesTheMomentsOfTheTruePosterior) {
  // The posterior is [pi N(x; rho, tau2) + (1 - pi) / range] N(rho) Beta(pi), integrated here on a grid.
  DepthBelief belief = DepthBelief::start(2.0, 1.0);
  belief.a = 12;
  belief.b = 8;
  const double x = 0.62, tau2 = 0.02 * 0.02;
  double mass = 0, rho1 = 0, rho2 = 0, pi1 = 0, pi2 = 0;
  for (int i = 0; i < 4000; ++i) {
    const double rho = belief.mu + belief.sigma() * (-8 + 16 * (i + 0.5) / 4000);
    const double prior = std::exp(-(rho - belief.mu) * (rho - belief.mu) / (2 * belief.sigma2));
    const double hit = std::exp(-(x - rho) * (x - rho) / (2 * tau2)) / std::sqrt(2 * M_PI * tau2);
    for (int k = 0; k < 200; ++k) {
      const double pi = (k + 0.5) / 200;
      const double weight =
          prior * std::pow(pi, belief.a - 1) * std::pow(1 - pi, belief.b - 1) * (pi * hit + (1 - pi) / belief.range);
      mass += weight;
      rho1 += weight * rho;
      rho2 += weight * rho * rho;
      pi1 += weight * pi;
      pi2 += weight * pi * pi;
    }
  }
  rho1 /= mass;
  rho2 /= mass;
  pi1 /= mass;
  pi2 /= mass;
  belief.update(x, tau2);
  EXPECT_NEAR(belief.mu, rho1, 1e-4);
  EXPECT_NEAR(belief.sigma2, rho2 - rho1 * rho1, 1e-5);
  EXPECT_NEAR(belief.inlier_ratio(), pi1, 1e-4);
  const double beta_second = belief.a * (belief.a + 1) / ((belief.a + belief.b) * (belief.a + belief.b + 1));
  EXPECT_NEAR(beta_second, pi2, 1e-4);
}

TEST(TrajectoryError, ASimilarityIsNoErrorAndAKnownOffsetIs) {
  std::vector<StampedPose> truth, estimate;
  const Eigen::Isometry3d moved = motion_exp((Vector6d() << 1, 2, 3, 0.3, 0.2, 0.1).finished());
  for (int i = 0; i < 10; ++i) {
    StampedPose pose;
    pose.time_s = 0.1 * i;
    pose.T_world_camera.translation() = Eigen::Vector3d(0.1 * i, std::sin(i), 0.2 * std::cos(2 * i));
    truth.push_back(pose);
    pose.T_world_camera = moved * pose.T_world_camera;
    pose.T_world_camera.translation() *= 0.5;
    estimate.push_back(pose);
  }
  const TrajectoryError similar = trajectory_error(estimate, truth, true);
  EXPECT_EQ(similar.poses, 10U);
  EXPECT_NEAR(similar.rmse_m, 0, 1e-9);
  EXPECT_NEAR(similar.scale, 2, 1e-9);
  EXPECT_GT(trajectory_error(estimate, truth, false).rmse_m, 0.1);
  // Four corners of a square with side 2, of which two opposite ones are raised by d and two lowered: no rigid motion
  // helps, every corner is off by d.
  std::vector<StampedPose> square, bent;
  const double xy[4][2] = {{1, 1}, {-1, 1}, {-1, -1}, {1, -1}};
  for (int i = 0; i < 4; ++i) {
    StampedPose pose;
    pose.time_s = i;
    pose.T_world_camera.translation() = Eigen::Vector3d(xy[i][0], xy[i][1], 0);
    square.push_back(pose);
    pose.T_world_camera.translation().z() = i % 2 == 0 ? 0.01 : -0.01;
    bent.push_back(pose);
  }
  EXPECT_NEAR(trajectory_error(bent, square, false).rmse_m, 0.01, 1e-6);
  EXPECT_DOUBLE_EQ(trajectory_error(bent, square, false).path_m, 6);
}

}  // namespace
}  // namespace vantage::tracking
