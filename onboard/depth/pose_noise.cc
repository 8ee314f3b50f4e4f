#include "onboard/depth/pose_noise.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>

namespace vantage {
namespace {

constexpr double kAdmitted = 2;  // nats below the highest likelihood: two standard deviations

}  // namespace

double PoseEvidence::log_likelihood(double shift, double turn) const {
  PosesVector narrower(images.rows());
  for (Eigen::Index i = 0; i < narrower.size(); ++i) narrower(i) = 1 / std::sqrt(i % 6 < 3 ? shift : turn);
  PosesMatrix posterior = images;
  posterior += narrower.asDiagonal() * prior * narrower.asDiagonal();
  const Eigen::LLT<PosesMatrix> solver(posterior);
  if (solver.info() != Eigen::Success) return -std::numeric_limits<double>::infinity();
  const double log_prior = 2 * narrower.array().log().sum();
  const double log_posterior = 2 * solver.matrixLLT().diagonal().array().log().sum();
  // gradient' posterior^-1 gradient, by the lower factor alone.
  const PosesVector half = solver.matrixL().solve(gradient);
  return 0.5 * (log_prior - log_posterior + half.squaredNorm());
}

double PoseNoise::factor(int log2) { return std::ldexp(1.0, log2); }

bool PoseNoise::judge(const PoseEvidence& evidence) {
  const int shift_was = shift_log2_, turn_was = turn_log2_;
  double best = evidence.log_likelihood(1, 1);
  const auto better = [&](int shift_step, int turn_step) {
    const int shift = std::clamp(shift_log2_ + shift_step, kLeastLog2, 0);
    const int turn = std::clamp(turn_log2_ + turn_step, kLeastLog2, 0);
    if (shift == shift_log2_ && turn == turn_log2_) return false;
    const double likelihood = evidence.log_likelihood(factor(shift - shift_was), factor(turn - turn_was));
    if (!(likelihood > best)) return false;
    best = likelihood;
    shift_log2_ = shift;
    turn_log2_ = turn;
    return true;
  };
  for (int step = 4; step >= 1; step /= 2) {
    while (better(step, 0) || better(-step, 0) || better(0, step) || better(0, -step)) {
    }
  }
  // A few views tell little: as large as they admit.
  const double admitted = best - kAdmitted;
  const auto admits = [&](int shift, int turn) {
    return shift <= 0 && turn <= 0 &&
           evidence.log_likelihood(factor(shift - shift_was), factor(turn - turn_was)) > admitted;
  };
  const int likeliest_shift = shift_log2_, likeliest_turn = turn_log2_;
  while (admits(shift_log2_ + 1, likeliest_turn)) ++shift_log2_;
  while (admits(likeliest_shift, turn_log2_ + 1)) ++turn_log2_;
  return std::abs(shift_log2_ - shift_was) > 1 || std::abs(turn_log2_ - turn_was) > 1;
}

}  // namespace vantage
