#include "offboard/experiment/cma_es.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <Eigen/Eigenvalues>

namespace vantage {

// Names and equation numbers are the tutorial's; constants its Table 1.
CmaEs::CmaEs(const Eigen::VectorXd& start, const CmaEsOptions& options)
    : mean_(start), sigma_(options.sigma), random_(options.seed) {
  const auto n = static_cast<double>(start.size());
  const int lambda = options.population > 0 ? options.population : 4 + static_cast<int>(3 * std::log(n));
  const int mu = lambda / 2;
  weights_.resize(mu);
  for (int i = 0; i < mu; ++i) weights_[i] = std::log((lambda + 1) / 2.0) - std::log(i + 1.0);
  weights_ /= weights_.sum();
  mu_effective_ = 1 / weights_.squaredNorm();
  c_sigma_ = (mu_effective_ + 2) / (n + mu_effective_ + 5);
  d_sigma_ = 1 + 2 * std::max(0.0, std::sqrt((mu_effective_ - 1) / (n + 1)) - 1) + c_sigma_;
  c_c_ = (4 + mu_effective_ / n) / (n + 4 + 2 * mu_effective_ / n);
  c_1_ = 2 / ((n + 1.3) * (n + 1.3) + mu_effective_);
  c_mu_ = std::min(1 - c_1_, 2 * (mu_effective_ - 2 + 1 / mu_effective_) / ((n + 2) * (n + 2) + mu_effective_));
  expected_norm_ = std::sqrt(n) * (1 - 1 / (4 * n) + 1 / (21 * n * n));
  path_sigma_ = path_c_ = Eigen::VectorXd::Zero(start.size());
  covariance_ = axes_ = Eigen::MatrixXd::Identity(start.size(), start.size());
  lengths_ = Eigen::VectorXd::Ones(start.size());
  candidates_.resize(static_cast<std::size_t>(lambda));
  draw();
}

void CmaEs::draw() {
  for (Eigen::VectorXd& candidate : candidates_) {
    Eigen::VectorXd z(mean_.size());
    for (double& number : z) number = random_.normal();
    candidate = mean_ + sigma_ * (axes_ * lengths_.cwiseProduct(z));  // (38)-(40)
  }
}

void CmaEs::tell(const std::vector<double>& values) {
  std::vector<std::size_t> order(candidates_.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return values[a] < values[b]; });
  const auto n = static_cast<double>(mean_.size());

  Eigen::VectorXd step = Eigen::VectorXd::Zero(mean_.size());  // <y>_w, (41)
  Eigen::MatrixXd spread = Eigen::MatrixXd::Zero(mean_.size(), mean_.size());
  for (Eigen::Index i = 0; i < weights_.size(); ++i) {
    const Eigen::VectorXd y = (candidates_[order[static_cast<std::size_t>(i)]] - mean_) / sigma_;
    step += weights_[i] * y;
    spread += weights_[i] * y * y.transpose();
  }
  mean_ += sigma_ * step;  // (42)

  const Eigen::VectorXd white = axes_ * lengths_.cwiseInverse().cwiseProduct(axes_.transpose() * step);
  path_sigma_ = (1 - c_sigma_) * path_sigma_ + std::sqrt(c_sigma_ * (2 - c_sigma_) * mu_effective_) * white;  // (43)
  ++generation_;
  const double grown = std::sqrt(1 - std::pow(1 - c_sigma_, 2.0 * generation_));
  const bool on_course = path_sigma_.norm() / grown < (1.4 + 2 / (n + 1)) * expected_norm_;  // h_sigma
  path_c_ *= 1 - c_c_;
  if (on_course) path_c_ += std::sqrt(c_c_ * (2 - c_c_) * mu_effective_) * step;  // (45)
  const double kept = 1 - c_1_ - c_mu_ + (on_course ? 0 : c_1_ * c_c_ * (2 - c_c_));
  covariance_ = kept * covariance_ + c_1_ * path_c_ * path_c_.transpose() + c_mu_ * spread;  // (47)
  sigma_ *= std::exp(c_sigma_ / d_sigma_ * (path_sigma_.norm() / expected_norm_ - 1));       // (44)

  covariance_ = 0.5 * (covariance_ + covariance_.transpose()).eval();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(covariance_);
  axes_ = eigen.eigenvectors();
  lengths_ = eigen.eigenvalues().cwiseMax(1e-20).cwiseSqrt();
  draw();
}

}  // namespace vantage
