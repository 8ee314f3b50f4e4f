#pragma once

#include <cmath>

namespace vantage::tracking {

/// What is known of one point's inverse distance rho (1/m, along its unit ray): Gaussian times Beta.
///
/// The measurement is the truth plus noise with the inlier ratio, anything in the range otherwise (Vogiatzis and
/// Hernandez, "Video-based, real-time multi-view stereo", 2011).
struct DepthBelief {
  double mu = 0;      ///< mean of rho
  double sigma2 = 0;  ///< its variance
  double a = 10, b = 10;
  double range = 0;  ///< width of the interval in which outliers lie

  /// Before any measurement: rho in about mu +- 3 sigma (Forster et al. 2014: sigma = range / 6).
  static DepthBelief start(double mean_distance, double nearest_distance) {
    DepthBelief belief;
    belief.mu = 1 / mean_distance;
    belief.range = 2 / nearest_distance;
    belief.sigma2 = belief.range * belief.range / 36;
    return belief;
  }

  double sigma() const { return std::sqrt(sigma2); }
  double inlier_ratio() const { return a / (a + b); }

  /// A measurement x of variance tau2.
  void update(double x, double tau2) {
    constexpr double kTwoPi = 6.283185307179586;
    const double variance = sigma2 + tau2;
    const double s2 = 1 / (1 / sigma2 + 1 / tau2);
    const double m = s2 * (mu / sigma2 + x / tau2);
    double c1 = a / (a + b) * std::exp(-(x - mu) * (x - mu) / (2 * variance)) / std::sqrt(kTwoPi * variance);
    double c2 = b / (a + b) / range;
    const double sum = c1 + c2;
    if (!(sum > 0) || !std::isfinite(sum)) return;
    c1 /= sum;
    c2 /= sum;
    const double f = c1 * (a + 1) / (a + b + 1) + c2 * a / (a + b + 1);
    const double e = (c1 * (a + 1) * (a + 2) + c2 * a * (a + 1)) / ((a + b + 1) * (a + b + 2));
    const double mean = c1 * m + c2 * mu;
    sigma2 = c1 * (s2 + m * m) + c2 * (sigma2 + mu * mu) - mean * mean;
    mu = mean;
    a = (e - f) / (f - e / f);
    b = a * (1 - f) / f;
  }

  void no_match() { b += 1; }
};

}  // namespace vantage::tracking
