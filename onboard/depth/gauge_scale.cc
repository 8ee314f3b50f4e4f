#include "onboard/depth/gauge_scale.h"

#include <cmath>
#include <limits>

#include <Eigen/Dense>

namespace vantage {

void GaugeScale::begin(const Eigen::Matrix3d& key_shift_covariance, double carried_sigma) {
  stations_.clear();
  key_information_ = (key_shift_covariance + 1e-12 * Eigen::Matrix3d::Identity()).inverse();
  carried_sigma_ = carried_sigma;
  scale_ = 1;
  sigma_ = carried_sigma > 0 ? carried_sigma : std::numeric_limits<double>::infinity();
  key_error_.setZero();
}

void GaugeScale::add(const Eigen::Isometry3d& T_frame_key, const Eigen::Vector3d& given_m,
                     const Eigen::Matrix3d& information) {
  if (stations_.size() == kMostStations) return;
  stations_.push_back({T_frame_key.linear(), T_frame_key.translation(), given_m, information});
}

/// given_i = s t_i + R_i c for the scale s and the key frame's error c.
bool GaugeScale::solve(double noise, Eigen::Vector4d* solution, double* sigma) const {
  Eigen::Matrix4d H = Eigen::Matrix4d::Zero();
  Eigen::Vector4d g = Eigen::Vector4d::Zero();
  H.bottomRightCorner<3, 3>() = key_information_ / noise;
  if (carried_sigma_ > 0) {
    H(0, 0) = 1 / (carried_sigma_ * carried_sigma_);
    g(0) = H(0, 0);
  }
  Eigen::Matrix<double, 3, 4> A;
  for (const Station& station : stations_) {
    A << station.t, station.R;
    H += A.transpose() * station.information * A / noise;
    g += A.transpose() * station.information * station.given / noise;
  }
  const Eigen::LDLT<Eigen::Matrix4d> solver(H);
  *solution = solver.solve(g);
  const double variance = solver.solve(Eigen::Vector4d::Unit(0))(0);
  *sigma = std::sqrt(variance);
  return solution->allFinite() && variance > 0;
}

void GaugeScale::follow(double noise) {
  Eigen::Vector4d solution;
  double sigma = 0;
  if (!solve(noise, &solution, &sigma)) return;
  if (!(solution(0) > 0.2 && solution(0) < 5)) return;  // not to be believed yet
  scale_ = solution(0);
  key_error_ = solution.tail<3>();
  sigma_ = sigma;
}

void GaugeScale::follow_sigma(double noise) {
  Eigen::Vector4d solution;
  double sigma = 0;
  if (solve(noise, &solution, &sigma)) sigma_ = sigma;
}

void GaugeScale::hold_metre() {
  scale_ = 1;
  key_error_.setZero();
}

double GaugeScale::make_unit_a_metre() {
  const double metres = scale_;
  for (Station& station : stations_) station.t *= metres;
  sigma_ /= metres;
  scale_ = 1;
  return metres;
}

}  // namespace vantage
