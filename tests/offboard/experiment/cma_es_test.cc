#include "offboard/experiment/cma_es.h"

#include <cmath>
#include <functional>

#include <gtest/gtest.h>

namespace vantage {
namespace {

using Function = std::function<double(const Eigen::VectorXd&)>;

double least_found(const Function& function, int dimensions, int evaluations, std::uint64_t seed) {
  CmaEs search(Eigen::VectorXd::Constant(dimensions, 1.5), {.sigma = 0.5, .seed = seed});
  double least = INFINITY;
  for (int i = 0; i < evaluations; i += static_cast<int>(search.ask().size())) {
    std::vector<double> values;
    for (const Eigen::VectorXd& x : search.ask()) {
      values.push_back(function(x));
      least = std::min(least, values.back());
    }
    search.tell(values);
  }
  return least;
}

TEST(CmaEs, FindsTheLeastOfASphere) {
  EXPECT_LT(least_found([](const Eigen::VectorXd& x) { return x.squaredNorm(); }, 8, 2500, 1), 1e-9);
}

TEST(CmaEs, LearnsTheScalesOfALongEllipsoid) {
  // Axes 1 to 1000: without an adapted covariance this takes hundreds of times as many evaluations.
  const Function ellipsoid = [](const Eigen::VectorXd& x) {
    double sum = 0;
    for (Eigen::Index i = 0; i < x.size(); ++i) {
      sum += std::pow(10, 6.0 * static_cast<double>(i) / static_cast<double>(x.size() - 1)) * x[i] * x[i];
    }
    return sum;
  };
  for (const std::uint64_t seed : {1U, 2U, 3U}) EXPECT_LT(least_found(ellipsoid, 8, 9000, seed), 1e-9) << seed;
}

TEST(CmaEs, FollowsTheBentValleyOfRosenbrock) {
  const Function valley = [](const Eigen::VectorXd& x) {
    double sum = 0;
    for (Eigen::Index i = 0; i + 1 < x.size(); ++i) {
      sum += 100 * std::pow(x[i + 1] - x[i] * x[i], 2) + std::pow(1 - x[i], 2);
    }
    return sum;
  };
  EXPECT_LT(least_found(valley, 4, 8000, 1), 1e-9);
}

TEST(CmaEs, RepeatsToTheBitAndDiffersWithTheSeed) {
  const auto third_generation = [](std::uint64_t seed) {
    CmaEs search(Eigen::VectorXd::Ones(5), {.sigma = 0.3, .seed = seed});
    for (int i = 0; i < 3; ++i) {
      std::vector<double> values;
      for (const Eigen::VectorXd& x : search.ask()) values.push_back(x.squaredNorm());
      search.tell(values);
    }
    return search.ask()[0];
  };
  EXPECT_EQ(third_generation(4), third_generation(4));
  EXPECT_NE(third_generation(4), third_generation(5));
}

}  // namespace
}  // namespace vantage
