#pragma once

#include <Eigen/Dense>

namespace vantage {

/// Poses that one adjustment holds at the most; matrices over them never take memory from the heap.
inline constexpr int kMostPoses = 11;
using PosesMatrix =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, 6 * kMostPoses, 6 * kMostPoses>;
using PosesVector = Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, 6 * kMostPoses, 1>;

/// What images and statements say of the errors e of given poses, (shift, turn) of each one below the other: images
/// cost e' images e / 2 + gradient' e, all else eliminated; e is normal, of information `prior`.
struct PoseEvidence {
  PosesMatrix images, prior;
  PosesVector gradient;

  /// Log of the images' likelihood, e integrated out, up to a constant, were the variances of shift and turn these
  /// multiples of the prior's.
  double log_likelihood(double shift, double turn) const;
};

/// How good given poses really are: variances of their shifts and turns over those stated, the most likely ones
/// (type II maximum likelihood, as in MacKay, "Bayesian interpolation", 1992). What is stated is an upper bound: images
/// whose camera is not known well would contradict the best of poses.
class PoseNoise {
 public:
  double shift() const { return factor(shift_log2_); }  ///< in [2^-14, 1]
  double turn() const { return factor(turn_log2_); }    ///< in [2^-14, 1]

  /// Moves both to where the likelihood is highest, in powers of two. `evidence`'s prior is of the present factors.
  /// False when that is where they were, to within a factor of two.
  bool judge(const PoseEvidence& evidence);

 private:
  static double factor(int log2);

  static constexpr int kLeastLog2 = -14;  ///< one percent of the stated sigma
  int shift_log2_ = kLeastLog2, turn_log2_ = kLeastLog2;
};

}  // namespace vantage
