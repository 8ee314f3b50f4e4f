#include "onboard/tracking/pose_refinement.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

namespace vantage::tracking {
namespace {

constexpr double kTukey = 4.685;
constexpr double kLeastScale =
    0.5;                         // of the whitened residuals: an alignment is not better than half a pixel of its level
constexpr double kInlier = 2.5;  // scales
constexpr double kHuber = 1.345;

struct Residual {
  Eigen::Vector2d r;
  Eigen::Matrix<double, 2, 6> jacobian;
  double size;
};

bool evaluate(const CameraModel& camera, const PoseMeasurement& m, const Eigen::Isometry3d& T, Residual* out) {
  Eigen::Vector2d pixel;
  Eigen::Matrix<double, 2, 3> projection;
  const Eigen::Vector3d point = T * m.position;
  if (!camera.project(point, &pixel, &projection)) return false;
  out->r = pixel - m.pixel;
  out->jacobian = projection * point_jacobian(point);
  const Eigen::Vector2d spread = projection * (T.linear() * m.spread);
  const double variance = m.sigma_px * m.sigma_px;
  if (m.edgelet) {
    const double across = m.normal.dot(spread);
    const double weight = 1 / std::sqrt(variance + across * across);
    const double r = m.normal.dot(out->r) * weight;
    const Eigen::Matrix<double, 1, 6> row = weight * m.normal.transpose() * out->jacobian;
    out->r = {r, 0};
    out->jacobian << row, Eigen::Matrix<double, 1, 6>::Zero();
  } else {
    const double length2 = spread.squaredNorm();
    Eigen::Matrix2d whitening = Eigen::Matrix2d::Identity() / m.sigma_px;
    if (length2 > 1e-8 * variance) {
      const Eigen::Vector2d along = spread / std::sqrt(length2), across(-along.y(), along.x());
      whitening.row(0) = along.transpose() / std::sqrt(variance + length2);
      whitening.row(1) = across.transpose() / m.sigma_px;
    }
    out->r = whitening * out->r;
    out->jacobian = whitening * out->jacobian;
  }
  out->size = out->r.norm();
  return true;
}

double tukey(double x) {
  if (x >= kTukey) return 0;
  const double y = 1 - x * x / (kTukey * kTukey);
  return y * y;
}

}  // namespace

void prior_residual(const PosePrior& prior, const Eigen::Isometry3d& T_camera_world, Vector6d* residual,
                    Matrix6d* jacobian) {
  const Eigen::Isometry3d error = T_camera_world * prior.T_world_camera;
  const Vector6d e = motion_log(error);
  Vector6d weight;
  weight << Eigen::Vector3d::Constant(1 / prior.sigma_translation_m),
      Eigen::Vector3d::Constant(1 / prior.sigma_rotation_rad);
  *residual = weight.cwiseProduct(e);
  const Eigen::Matrix3d phi = skew(e.tail<3>());
  jacobian->setZero();
  jacobian->topRows<3>() = point_jacobian(e.head<3>());
  jacobian->bottomRightCorner<3, 3>() = Eigen::Matrix3d::Identity() - 0.5 * phi + phi * phi / 12;
  *jacobian = weight.asDiagonal() * *jacobian;
}

RefinedPose refine_pose(const CameraModel& camera, std::span<PoseMeasurement> measurements,
                        const std::optional<PosePrior>& prior, Eigen::Isometry3d* T_camera_world, int iterations) {
  RefinedPose result;
  thread_local std::vector<double> sizes;  // keeps its memory from frame to frame
  double scale = 1;
  Eigen::Isometry3d T = *T_camera_world;
  Matrix6d H;
  for (int iteration = 0; iteration <= iterations; ++iteration) {
    if (iteration < 4) {
      // The scale settles while the pose does; a later one that keeps shrinking would throw good points out.
      sizes.clear();
      for (const PoseMeasurement& m : measurements) {
        Residual residual;
        if (evaluate(camera, m, T, &residual)) sizes.push_back(residual.size);
      }
      if (sizes.empty()) return result;
      const auto middle = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
      std::nth_element(sizes.begin(), middle, sizes.end());
      scale = std::max(kLeastScale, 1.4826 * *middle);
    }
    H.setZero();
    Vector6d b = Vector6d::Zero();
    for (const PoseMeasurement& m : measurements) {
      Residual residual;
      if (!evaluate(camera, m, T, &residual)) continue;
      const double weight = tukey(residual.size / scale) / (scale * scale);
      H.noalias() += weight * residual.jacobian.transpose() * residual.jacobian;
      b.noalias() -= weight * residual.jacobian.transpose() * residual.r;
    }
    if (prior) {
      Vector6d r;
      Matrix6d jacobian;
      prior_residual(*prior, T, &r, &jacobian);
      H += jacobian.transpose() * jacobian;
      b -= jacobian.transpose() * r;
    }
    if (iteration == iterations) break;
    const Vector6d step = H.ldlt().solve(b);
    if (!step.allFinite()) break;
    T = renormalized(motion_exp(step) * T);
    if (step.cwiseAbs().maxCoeff() < 1e-8) break;
  }
  double sum = 0;
  for (PoseMeasurement& m : measurements) {
    Residual residual;
    m.inlier = evaluate(camera, m, T, &residual) && residual.size < kInlier * scale;
    if (!m.inlier) continue;
    ++result.inliers;
    sum += residual.size * residual.size;
  }
  result.rms_px = result.inliers > 0 ? std::sqrt(sum / result.inliers) : 0;
  const Eigen::LDLT<Matrix6d> ldlt(H);
  if (ldlt.info() == Eigen::Success && ldlt.isPositive() && ldlt.rcond() > 1e-14) {
    result.covariance = ldlt.solve(Matrix6d::Identity());
  } else {
    result.covariance = Matrix6d::Identity() * 1e6;
  }
  *T_camera_world = T;
  return result;
}

bool refine_point(const CameraModel& camera, const Map& map, Landmark* landmark, int iterations) {
  Eigen::Vector3d position = landmark->position;
  double best = 1e300;
  for (int iteration = 0; iteration <= iterations; ++iteration) {
    Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
    Eigen::Vector3d b = Eigen::Vector3d::Zero();
    double cost = 0;
    for (const Observation& observation : landmark->observations) {
      const KeyFrame* frame = map.key_frame(observation.key_frame);
      if (frame == nullptr) continue;
      Eigen::Vector2d pixel;
      Eigen::Matrix<double, 2, 3> projection;
      if (!camera.project(frame->T_camera_world * position, &pixel, &projection)) return false;
      const double sigma = 1 << observation.level;
      Eigen::Vector2d r = (pixel - observation.pixel) / sigma;
      Eigen::Matrix<double, 2, 3> jacobian = projection * frame->T_camera_world.linear() / sigma;
      if (landmark->edgelet) {
        r = {observation.normal.dot(r), 0};
        jacobian.row(0) = (observation.normal.transpose() * jacobian).eval();
        jacobian.row(1).setZero();
      }
      const double size = r.norm(), weight = size < kHuber ? 1 : kHuber / size;
      H.noalias() += weight * jacobian.transpose() * jacobian;
      b.noalias() -= weight * jacobian.transpose() * r;
      cost += size < kHuber ? 0.5 * size * size : kHuber * (size - 0.5 * kHuber);
    }
    if (cost > best) return true;
    best = cost;
    landmark->position = position;
    if (iteration == iterations) break;
    H.diagonal().array() *= 1 + 1e-6;  // two views leave the depth weak, one edgelet leaves a line free
    const Eigen::Vector3d step = H.ldlt().solve(b);
    if (!step.allFinite() || step.norm() > 0.2 * position.norm() + 1e-3) return false;
    position += step;
  }
  return true;
}

}  // namespace vantage::tracking
