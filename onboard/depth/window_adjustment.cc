#include "onboard/depth/window_adjustment.h"

#include <algorithm>
#include <cmath>

namespace vantage {
namespace {

using Eigen::Index;
using Eigen::Isometry3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;

constexpr double kHuber = 1.5;        // sigmas
constexpr double kLeastDepth = 0.05;  // of a point over its depth in the key frame: nearer it is not in front

/// d with exp(d) B = A for the `moved` above.
Vector6d difference(const Isometry3d& A, const Isometry3d& B) {
  const Isometry3d step = A * B.inverse();
  const Eigen::AngleAxisd turn(step.linear());
  Vector6d d;
  d.head<3>() = step.translation();
  d.tail<3>() = turn.angle() * turn.axis();
  return d;
}

/// One corner in one view: residual and Jacobians by the pose and the inverse depth.
struct Observation {
  Vector2d residual;
  Eigen::Matrix<double, 2, 6> by_pose;
  Vector2d by_inverse;
};

/// False when the corner was not found there or is not in front of the camera.
bool residual_of(const CameraModel& camera, const AdjustedView& view, const AdjustedCorner& corner, std::size_t k,
                 Vector3d* P, Vector2d* residual) {
  if (!view.places[k].found) return false;
  *P = view.T.linear() * corner.ray + corner.inverse * view.T.translation();
  if (P->z() < kLeastDepth) return false;
  *residual = Vector2d(camera.fx * P->x() / P->z() + camera.cx, camera.fy * P->y() / P->z() + camera.cy) -
              view.places[k].position.cast<double>();
  return true;
}

bool observe(const CameraModel& camera, const AdjustedView& view, const AdjustedCorner& corner, std::size_t k,
             Observation* o) {
  Vector3d P;
  if (!residual_of(camera, view, corner, k, &P, &o->residual)) return false;
  const double iz = 1 / P.z();
  Eigen::Matrix<double, 2, 3> K;
  K << camera.fx * iz, 0, -camera.fx * P.x() * iz * iz, 0, camera.fy * iz, -camera.fy * P.y() * iz * iz;
  // P = R ray + inverse t: exp(shift, turn) adds inverse * shift + turn x P.
  Eigen::Matrix3d cross;
  cross << 0, -P.z(), P.y(), P.z(), 0, -P.x(), -P.y(), P.x(), 0;
  o->by_pose.leftCols<3>() = corner.inverse * K;
  o->by_pose.rightCols<3>() = -K * cross;
  o->by_inverse = K * view.T.translation();
  return true;
}

/// \pre not empty; the order is changed.
double median(std::vector<double>* values) {
  const auto middle = values->begin() + static_cast<std::ptrdiff_t>(values->size() / 2);
  std::nth_element(values->begin(), middle, values->end());
  return *middle;
}

double huber_weight(double sigmas) { return sigmas > kHuber ? kHuber / sigmas : 1; }
double huber_cost(double sigmas) { return sigmas > kHuber ? kHuber * (sigmas - 0.5 * kHuber) : 0.5 * sigmas * sigmas; }

}  // namespace

Isometry3d moved(const Isometry3d& T, const Vector6d& d) {
  Isometry3d step = Isometry3d::Identity();
  const double angle = d.tail<3>().norm();
  if (angle > 0) step.linear() = Eigen::AngleAxisd(angle, d.tail<3>() / angle).toRotationMatrix();
  step.translation() = d.head<3>();
  return step * T;
}

void WindowAdjustment::reserve(std::size_t corners) {
  eliminated_.reserve(corners);
  inverses_.reserve(corners);
  lengths_.reserve(corners * kMostPoses);
}

double WindowAdjustment::cost(std::span<AdjustedView* const> views, const std::vector<AdjustedCorner>& corners,
                              double pixel_sigma) const {
  double sum = 0;
  Vector3d P;
  Vector2d residual;
  for (const AdjustedView* view : views) {
    const Vector6d off = difference(view->T, view->prior);
    sum += 0.5 * off.dot(view->information * off);
    for (std::size_t k = 0; k < corners.size(); ++k) {
      if (residual_of(camera_, *view, corners[k], k, &P, &residual)) sum += huber_cost(residual.norm() / pixel_sigma);
    }
  }
  for (const AdjustedCorner& corner : corners) {
    const double off = (corner.inverse - corner.prior_mean) / corner.prior_sigma;
    sum += 0.5 * off * off;
  }
  return sum;
}

/// Fills the reduced normal equations and what brings the corners back from them.
double WindowAdjustment::linearise(std::span<AdjustedView* const> views, const std::vector<AdjustedCorner>& corners,
                                   double pixel_sigma) {
  const auto size = static_cast<Index>(6 * views.size());
  H_.setZero(size, size);
  g_.setZero(size);
  eliminated_.resize(corners.size());
  for (std::size_t i = 0; i < views.size(); ++i) {
    const auto at = static_cast<Index>(6 * i);
    H_.block<6, 6>(at, at) += views[i]->information;
    g_.segment<6>(at) += views[i]->information * difference(views[i]->T, views[i]->prior);
  }
  Observation o;
  for (std::size_t k = 0; k < corners.size(); ++k) {
    Elimination& e = eliminated_[k];
    const double prior_information = 1 / (corners[k].prior_sigma * corners[k].prior_sigma);
    e.information = prior_information;
    e.gradient = (corners[k].inverse - corners[k].prior_mean) * prior_information;
    e.coupling.setZero(size);
    for (std::size_t i = 0; i < views.size(); ++i) {
      if (!observe(camera_, *views[i], corners[k], k, &o)) continue;
      const double weight = huber_weight(o.residual.norm() / pixel_sigma) / (pixel_sigma * pixel_sigma);
      const auto at = static_cast<Index>(6 * i);
      H_.block<6, 6>(at, at) += weight * o.by_pose.transpose() * o.by_pose;
      g_.segment<6>(at) += weight * o.by_pose.transpose() * o.residual;
      e.coupling.segment<6>(at) = weight * o.by_pose.transpose() * o.by_inverse;
      e.information += weight * o.by_inverse.squaredNorm();
      e.gradient += weight * o.by_inverse.dot(o.residual);
    }
    H_.selfadjointView<Eigen::Lower>().rankUpdate(e.coupling, -1 / e.information);
    g_ -= e.coupling * (e.gradient / e.information);
  }
  return cost(views, corners, pixel_sigma);
}

double WindowAdjustment::run(std::span<AdjustedView* const> views, std::vector<AdjustedCorner>& corners,
                             double pixel_sigma, int iterations) {
  double damping = 1e-4;
  double now = linearise(views, corners, pixel_sigma);
  inverses_.resize(corners.size());
  for (int iteration = 0; iteration < iterations; ++iteration) {
    for (std::size_t i = 0; i < views.size(); ++i) poses_[i] = views[i]->T;
    for (std::size_t k = 0; k < corners.size(); ++k) inverses_[k] = corners[k].inverse;
    damped_ = H_;
    damped_.diagonal() *= 1 + damping;
    const Eigen::LLT<Eigen::Ref<PosesMatrix>, Eigen::Lower> solver(damped_);
    if (solver.info() != Eigen::Success) {
      damping *= 100;
      continue;
    }
    const PosesVector step = -solver.solve(g_);
    for (std::size_t i = 0; i < views.size(); ++i) {
      views[i]->T = moved(poses_[i], step.segment<6>(static_cast<Index>(6 * i)));
    }
    for (std::size_t k = 0; k < corners.size(); ++k) {
      const Elimination& e = eliminated_[k];
      const double change = -(e.gradient + e.coupling.dot(step)) / e.information;
      corners[k].inverse = std::clamp(inverses_[k] + change, low_, high_);
    }
    const double next = cost(views, corners, pixel_sigma);
    if (next < now) {
      const bool settled = now - next < 1e-6 * now;
      now = linearise(views, corners, pixel_sigma);
      damping = std::max(1e-7, 0.1 * damping);
      if (settled) break;
    } else {
      for (std::size_t i = 0; i < views.size(); ++i) views[i]->T = poses_[i];
      for (std::size_t k = 0; k < corners.size(); ++k) corners[k].inverse = inverses_[k];
      damping *= 30;
    }
  }
  return now;
}

void WindowAdjustment::run_structure(std::span<AdjustedView* const> views, std::vector<AdjustedCorner>& corners,
                                     double pixel_sigma, int iterations) {
  Observation o;
  for (std::size_t k = 0; k < corners.size(); ++k) {
    for (int iteration = 0; iteration < iterations; ++iteration) {
      const double prior_information = 1 / (corners[k].prior_sigma * corners[k].prior_sigma);
      double information = prior_information,
             gradient = (corners[k].inverse - corners[k].prior_mean) * prior_information;
      for (const AdjustedView* view : views) {
        if (!observe(camera_, *view, corners[k], k, &o)) continue;
        const double weight = huber_weight(o.residual.norm() / pixel_sigma) / (pixel_sigma * pixel_sigma);
        information += weight * o.by_inverse.squaredNorm();
        gradient += weight * o.by_inverse.dot(o.residual);
      }
      corners[k].inverse = std::clamp(corners[k].inverse - gradient / information, low_, high_);
    }
  }
}

void WindowAdjustment::weigh(std::span<AdjustedView* const> views, PoseEvidence* evidence) const {
  evidence->images = H_.selfadjointView<Eigen::Lower>();
  evidence->gradient = g_;
  evidence->prior.setZero(H_.rows(), H_.cols());
  PosesVector error(H_.rows());
  for (std::size_t i = 0; i < views.size(); ++i) {
    const auto at = static_cast<Index>(6 * i);
    error.segment<6>(at) = difference(views[i]->T, views[i]->prior);
    evidence->prior.block<6, 6>(at, at) = views[i]->information;
    evidence->images.block<6, 6>(at, at) -= views[i]->information;
    evidence->gradient.segment<6>(at) -= views[i]->information * error.segment<6>(at);
  }
  // From where the poses are to where they were given.
  evidence->gradient.noalias() -= evidence->images * error;
}

double WindowAdjustment::corner_sigma(const std::vector<AdjustedCorner>& corners) {
  lengths_.clear();
  for (std::size_t k = 0; k < corners.size(); ++k) {
    lengths_.push_back(1 / (std::sqrt(eliminated_[k].information) * corners[k].inverse));
  }
  return median(&lengths_);
}

Matrix6d WindowAdjustment::last_covariance() const {
  Eigen::Matrix<double, Eigen::Dynamic, 6, Eigen::ColMajor, 6 * kMostPoses, 6> unit(H_.rows(), 6);
  unit.setZero();
  unit.bottomRows<6>().setIdentity();
  const Eigen::LLT<PosesMatrix, Eigen::Lower> solver(H_);
  solver.solveInPlace(unit);
  return unit.bottomRows<6>();
}

double WindowAdjustment::residual_sigma(std::span<AdjustedView* const> views,
                                        const std::vector<AdjustedCorner>& corners) {
  lengths_.clear();
  Vector3d P;
  Vector2d residual;
  for (const AdjustedView* view : views) {
    for (std::size_t k = 0; k < corners.size(); ++k) {
      if (residual_of(camera_, *view, corners[k], k, &P, &residual)) lengths_.push_back(residual.norm());
    }
  }
  if (lengths_.empty()) return 0;
  constexpr double kRayleighMedian = 1.1774;  // of a length whose two components have sigma 1
  return median(&lengths_) / kRayleighMedian;
}

}  // namespace vantage
