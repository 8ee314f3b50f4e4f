#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "offboard/experiment/split_mix.h"

namespace vantage {

struct CmaEsOptions {
  double sigma = 0.5;  ///< first standard deviation of every coordinate, > 0
  int population = 0;  ///< candidates a generation, > 3; 0: 4 + 3 ln n
  std::uint64_t seed = 1;
};

/// Covariance matrix adaptation: finds a small value of a function by its values alone, also where they are noisy or
/// have steps. Hansen, "The CMA evolution strategy: a tutorial", 2016 (arXiv 1604.00772), without negative weights.
///
///     CmaEs search(start, options);
///     while (...) search.tell(values_of(search.ask()));   // a smaller value is better
///     use(search.mean());
///
/// Same start, options and values, same candidates.
class CmaEs {
 public:
  /// \pre start.size() > 0 and finite; options as they say
  CmaEs(const Eigen::VectorXd& start, const CmaEsOptions& options);

  /// The next generation; the same until `tell`.
  const std::vector<Eigen::VectorXd>& ask() const { return candidates_; }
  /// Values of ask()'s candidates, in their order; none may be NaN.
  void tell(const std::vector<double>& values);

  /// Centre of the search.
  const Eigen::VectorXd& mean() const { return mean_; }
  double sigma() const { return sigma_; }

 private:
  void draw();

  Eigen::VectorXd mean_;
  double sigma_;
  SplitMix random_;
  Eigen::VectorXd weights_;  // of the better half, best first
  double mu_effective_, c_sigma_, d_sigma_, c_c_, c_1_, c_mu_, expected_norm_;
  Eigen::VectorXd path_sigma_, path_c_;
  Eigen::MatrixXd covariance_, axes_;  // axes_: eigenvectors in columns
  Eigen::VectorXd lengths_;            // square roots of the eigenvalues
  std::vector<Eigen::VectorXd> candidates_;
  int generation_ = 0;
};

}  // namespace vantage
