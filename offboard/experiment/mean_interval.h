#pragma once

#include <optional>
#include <span>

namespace vantage {

/// A mean of repeated measurements and how far the true mean may lie from it.
struct MeanInterval {
  double mean = 0;
  double least = 0, largest = 0;
  /// Half the width of the confidence interval of the mean at 95 % (Student's t, which assumes about normal and
  /// independent values); nothing for a single value.
  std::optional<double> half_width;
};

/// \pre at least one value
MeanInterval mean_interval(std::span<const double> values);

/// The t that a Student-distributed number of so many degrees of freedom stays within, both ways, in 95 of 100 cases.
/// \pre degrees >= 1
double student_t_95(int degrees);

}  // namespace vantage
