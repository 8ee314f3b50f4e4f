#include "onboard/tracking/bundle_adjustment.h"

#include <array>
#include <cmath>

#include <ceres/ceres.h>

#include "onboard/tracking/pose_refinement.h"
#include "onboard/tracking/rigid_motion.h"

namespace vantage::tracking {
namespace {

constexpr double kInlier = 2.5;  // sigmas

/// A pose as Ceres holds it: quaternion x y z w, translation.
using PoseBlock = std::array<double, 7>;

PoseBlock block_of(const Eigen::Isometry3d& T) {
  const Eigen::Quaterniond q(T.linear());
  return {q.x(), q.y(), q.z(), q.w(), T.translation().x(), T.translation().y(), T.translation().z()};
}

Eigen::Isometry3d pose_of(const double* block) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = Eigen::Quaterniond(block[3], block[0], block[1], block[2]).normalized().toRotationMatrix();
  T.translation() = Eigen::Map<const Eigen::Vector3d>(block + 4);
  return T;
}

/// T <- motion_exp(xi) T. Costs give d / d xi in their first six columns and zero in the seventh, which makes the
/// manifold's own Jacobian the identity over a row of zeros.
class PoseManifold final : public ceres::Manifold {
 public:
  int AmbientSize() const override { return 7; }
  int TangentSize() const override { return 6; }
  bool Plus(const double* x, const double* delta, double* x_plus_delta) const override {
    const Eigen::Isometry3d T = motion_exp(Eigen::Map<const Vector6d>(delta)) * pose_of(x);
    const PoseBlock block = block_of(T);
    std::copy(block.begin(), block.end(), x_plus_delta);
    return true;
  }
  bool PlusJacobian(const double*, double* jacobian) const override {
    Eigen::Map<Eigen::Matrix<double, 7, 6, Eigen::RowMajor>> J(jacobian);
    J.setZero();
    J.topRows<6>().setIdentity();
    return true;
  }
  bool Minus(const double* y, const double* x, double* y_minus_x) const override {
    Eigen::Map<Vector6d> difference(y_minus_x);
    difference = motion_log(pose_of(y) * pose_of(x).inverse());
    return true;
  }
  bool MinusJacobian(const double*, double* jacobian) const override {
    Eigen::Map<Eigen::Matrix<double, 6, 7, Eigen::RowMajor>> J(jacobian);
    J.setZero();
    J.leftCols<6>().setIdentity();
    return true;
  }
};

class ReprojectionCost final : public ceres::SizedCostFunction<2, 7, 3> {
 public:
  ReprojectionCost(const CameraModel& camera, const AdjustedObservation& observation)
      : camera_(camera), observation_(observation) {}

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const Eigen::Isometry3d T = pose_of(parameters[0]);
    const Eigen::Vector3d point = T * Eigen::Map<const Eigen::Vector3d>(parameters[1]);
    Eigen::Vector2d pixel;
    Eigen::Matrix<double, 2, 3> projection;
    Eigen::Map<Eigen::Vector2d> r(residuals);
    const bool visible = camera_.project(point, &pixel, &projection);
    Eigen::Matrix2d weight = Eigen::Matrix2d::Identity() / observation_.sigma_px;
    if (observation_.edgelet) {
      weight.row(0) = observation_.normal.transpose() / observation_.sigma_px;
      weight.row(1).setZero();
    }
    if (!visible) {  // behind the camera: a constant cost that Huber keeps from ruling
      r.setConstant(100);
      projection.setZero();
    } else {
      r = weight * (pixel - observation_.pixel);
    }
    if (jacobians == nullptr) return true;
    if (jacobians[0] != nullptr) {
      Eigen::Map<Eigen::Matrix<double, 2, 7, Eigen::RowMajor>> J(jacobians[0]);
      J.leftCols<6>() = weight * projection * point_jacobian(point);
      J.col(6).setZero();
    }
    if (jacobians[1] != nullptr) {
      Eigen::Map<Eigen::Matrix<double, 2, 3, Eigen::RowMajor>> J(jacobians[1]);
      J = weight * projection * T.linear();
    }
    return true;
  }

 private:
  const CameraModel& camera_;
  const AdjustedObservation& observation_;
};

class PriorCost final : public ceres::SizedCostFunction<6, 7> {
 public:
  explicit PriorCost(const PosePrior& prior) : prior_(prior) {}
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    Vector6d r;
    Matrix6d jacobian;
    prior_residual(prior_, pose_of(parameters[0]), &r, &jacobian);
    Eigen::Map<Vector6d>{residuals} = r;
    if (jacobians != nullptr && jacobians[0] != nullptr) {
      Eigen::Map<Eigen::Matrix<double, 6, 7, Eigen::RowMajor>> J(jacobians[0]);
      J.leftCols<6>() = jacobian;
      J.col(6).setZero();
    }
    return true;
  }

 private:
  PosePrior prior_;
};

/// Distance between two camera centres, relative to what it was.
class DistanceCost final : public ceres::SizedCostFunction<1, 7, 7> {
 public:
  explicit DistanceCost(double distance_m) : distance_m_(distance_m) {}
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    constexpr double kWeight = 1e4;
    const Eigen::Isometry3d a = pose_of(parameters[0]), b = pose_of(parameters[1]);
    const Eigen::Vector3d difference = a.inverse().translation() - b.inverse().translation();
    const double distance = std::max(difference.norm(), 1e-12);
    residuals[0] = kWeight * (distance / distance_m_ - 1);
    if (jacobians == nullptr) return true;
    // The centre -R^T t moves by -R^T v with a step v of translation and not at all with one of rotation.
    const Eigen::RowVector3d unit = kWeight / (distance_m_ * distance) * difference.transpose();
    for (int k = 0; k < 2; ++k) {
      if (jacobians[k] == nullptr) continue;
      Eigen::Map<Eigen::Matrix<double, 1, 7>> J(jacobians[k]);
      J.setZero();
      const Eigen::Isometry3d& T = k == 0 ? a : b;
      // d centre / d xi: t -> v + w x t, R -> exp(w) R: centre' = -R^T exp(-w)(v + exp(w) t) = centre - R^T v.
      J.head<3>() = (k == 0 ? -1 : 1) * unit * T.linear().transpose();
    }
    return true;
  }

 private:
  double distance_m_;
};

}  // namespace

bool AdjustmentOptions::valid(std::string* why) const {
  const auto fail = [why](const char* reason) {
    if (why != nullptr) *why = reason;
    return false;
  };
  if (iterations < 1) return fail("iterations must be positive");
  if (!(huber > 0)) return fail("huber must be positive");
  if (!(seconds >= 0)) return fail("seconds must not be negative");
  return true;
}

AdjustmentSummary adjust(const CameraModel& camera, AdjustmentProblem* problem, const AdjustmentOptions& options) {
  std::vector<PoseBlock> poses;
  poses.reserve(problem->poses.size());
  for (const AdjustedPose& pose : problem->poses) poses.push_back(block_of(pose.T_camera_world));

  ceres::Problem::Options problem_options;
  problem_options.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  problem_options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  problem_options.enable_fast_removal = false;
  problem_options.disable_all_safety_checks = true;
  PoseManifold manifold;
  ceres::HuberLoss huber(options.huber);
  ceres::Problem ceres_problem(problem_options);
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  for (std::size_t i = 0; i < poses.size(); ++i) {
    ceres_problem.AddParameterBlock(poses[i].data(), 7, &manifold);
    ordering->AddElementToGroup(poses[i].data(), 1);
    if (problem->poses[i].fixed) {
      ceres_problem.SetParameterBlockConstant(poses[i].data());
    } else if (problem->poses[i].prior) {
      ceres_problem.AddResidualBlock(new PriorCost(*problem->poses[i].prior), nullptr, poses[i].data());
    }
  }
  for (Eigen::Vector3d& point : problem->points) {
    ceres_problem.AddParameterBlock(point.data(), 3);
    ordering->AddElementToGroup(point.data(), 0);
  }
  for (const AdjustedObservation& o : problem->observations) {
    ceres_problem.AddResidualBlock(new ReprojectionCost(camera, o), &huber,
                                   poses[static_cast<std::size_t>(o.pose)].data(),
                                   problem->points[static_cast<std::size_t>(o.point)].data());
  }
  if (problem->kept_distance) {
    const auto a = static_cast<std::size_t>(problem->kept_distance->first),
               b = static_cast<std::size_t>(problem->kept_distance->second);
    const double distance = (problem->poses[a].T_camera_world.inverse().translation() -
                             problem->poses[b].T_camera_world.inverse().translation())
                                .norm();
    if (distance > 0) {
      ceres_problem.AddResidualBlock(new DistanceCost(distance), nullptr, poses[a].data(), poses[b].data());
    }
  }
  ceres::Solver::Options solver;
  solver.linear_solver_type = ceres::DENSE_SCHUR;
  solver.linear_solver_ordering = ordering;
  solver.num_threads = 1;
  solver.max_num_iterations = options.iterations;
  solver.logging_type = ceres::SILENT;
  solver.function_tolerance = 1e-6;
  if (options.seconds > 0) solver.max_solver_time_in_seconds = options.seconds;
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &ceres_problem, &summary);

  AdjustmentSummary result;
  result.usable = summary.IsSolutionUsable();
  if (!result.usable) return result;
  for (std::size_t i = 0; i < poses.size(); ++i) problem->poses[i].T_camera_world = pose_of(poses[i].data());
  double sum = 0;
  int inliers = 0;
  for (AdjustedObservation& o : problem->observations) {
    Eigen::Vector2d pixel;
    const Eigen::Isometry3d& T = problem->poses[static_cast<std::size_t>(o.pose)].T_camera_world;
    o.inlier = camera.project(T * problem->points[static_cast<std::size_t>(o.point)], &pixel);
    if (o.inlier) {
      const double error = o.edgelet ? std::abs(o.normal.dot(pixel - o.pixel)) : (pixel - o.pixel).norm();
      o.inlier = error < kInlier * o.sigma_px;
      if (o.inlier) sum += error * error / (o.sigma_px * o.sigma_px);
    }
    ++(o.inlier ? inliers : result.outliers);
  }
  result.rms = inliers > 0 ? std::sqrt(sum / inliers) : 0;
  return result;
}

}  // namespace vantage::tracking
