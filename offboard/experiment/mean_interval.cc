#include "offboard/experiment/mean_interval.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace vantage {
namespace {

/// Probability that |T| <= t (Abramowitz and Stegun, "Handbook of mathematical functions", 26.7.3 and 26.7.4).
double probability_within(double t, int degrees) {
  const double angle = std::atan(t / std::sqrt(degrees)), cosine = std::cos(angle), squared = cosine * cosine;
  double term = degrees % 2 == 0 ? 1 : cosine, sum = degrees == 1 ? 0 : term;
  for (int k = degrees % 2 == 0 ? 2 : 3; k < degrees; k += 2) {
    term *= squared * (k - 1) / k;
    sum += term;
  }
  return degrees % 2 == 0 ? std::sin(angle) * sum : 2 / std::numbers::pi * (angle + std::sin(angle) * sum);
}

}  // namespace

double student_t_95(int degrees) {
  double low = 1, high = 16;  // 12.7 for one degree of freedom, 1.96 for very many
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (probability_within(middle, degrees) < 0.95 ? low : high) = middle;
  }
  return high;
}

MeanInterval mean_interval(std::span<const double> values) {
  const auto count = static_cast<double>(values.size());
  MeanInterval interval;
  interval.least = *std::min_element(values.begin(), values.end());
  interval.largest = *std::max_element(values.begin(), values.end());
  for (const double value : values) interval.mean += value / count;
  if (values.size() < 2) return interval;
  double squares = 0;
  for (const double value : values) squares += (value - interval.mean) * (value - interval.mean);
  interval.half_width = student_t_95(static_cast<int>(values.size()) - 1) * std::sqrt(squares / (count - 1) / count);
  return interval;
}

}  // namespace vantage
