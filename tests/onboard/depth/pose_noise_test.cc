#include "onboard/depth/pose_noise.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

namespace vantage {
namespace {

/// Poses whose errors are `shift` and `turn` times the stated variances, and images that know them to a hundredth of
/// the stated sigmas, more or less, all poses together.
class Trial {
 public:
  Trial(unsigned seed, int poses, double shift, double turn) : size_(6 * poses), random_(seed) {
    const Eigen::MatrixXd A = Eigen::MatrixXd::NullaryExpr(size_, size_, [&] { return normal_(random_); });
    Eigen::VectorXd sharpness(size_), stated(size_), error(size_), matching(size_);
    for (Eigen::Index i = 0; i < size_; ++i) {
      sharpness(i) = std::pow(10.0, 3 + normal_(random_) / 2);
      stated(i) = i % 6 < 3 ? 1e-3 : 1e-2;
      error(i) = std::sqrt(i % 6 < 3 ? shift : turn) * stated(i) * normal_(random_);
      matching(i) = normal_(random_);
    }
    const Eigen::MatrixXd root = sharpness.asDiagonal() *
                                 Eigen::MatrixXd(A.householderQr().householderQ()).transpose() *
                                 stated.cwiseInverse().asDiagonal();
    images_ = 0.1 * 0.1 * root.transpose() * root;
    gradient_ = -images_ * error + 0.1 * root.transpose() * matching;
    prior_ = stated.array().square().inverse().matrix();
  }

  /// Judges until nothing changes, as the adjustment does.
  PoseNoise judged() const {
    PoseNoise noise;
    for (int round = 0; round < 8; ++round) {
      PoseEvidence evidence;
      evidence.images = images_;
      evidence.gradient = gradient_;
      evidence.prior = PosesMatrix::Zero(size_, size_);
      for (Eigen::Index i = 0; i < size_; ++i) {
        evidence.prior(i, i) = prior_(i) / (i % 6 < 3 ? noise.shift() : noise.turn());
      }
      if (!noise.judge(evidence)) break;
    }
    return noise;
  }

 private:
  Eigen::Index size_;
  std::mt19937 random_;
  std::normal_distribution<double> normal_{0, 1};
  Eigen::MatrixXd images_;
  Eigen::VectorXd gradient_, prior_;
};

TEST(PoseNoiseTest, FindsShiftsAndTurnsOfAnyNoiseWithinAFactor) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    for (const double shift : {1.0, 1.0 / 16, 1.0 / 512}) {
      for (const double turn : {1.0, 1.0 / 16, 1.0 / 512}) {
        SCOPED_TRACE(testing::Message() << "seed " << seed << ", shift " << shift << ", turn " << turn);
        const PoseNoise noise = Trial(seed, kMostPoses, shift, turn).judged();
        // 33 errors of each kind: a variance is known to 25 %, and the upper end of what is likely is taken.
        EXPECT_GE(noise.shift(), shift / 2);
        EXPECT_LE(noise.shift(), 4 * shift);
        EXPECT_GE(noise.turn(), turn / 2);
        EXPECT_LE(noise.turn(), 4 * turn);
      }
    }
  }
}

TEST(PoseNoiseTest, ExactPosesAreFoundToBeSo) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const PoseNoise noise = Trial(seed, kMostPoses, 0, 0).judged();
    EXPECT_LT(noise.shift(), 1e-3) << "seed " << seed;
    EXPECT_LT(noise.turn(), 1e-3) << "seed " << seed;
  }
}

TEST(PoseNoiseTest, WhatIsStatedIsABound) {
  const PoseNoise noise = Trial(1, kMostPoses, 25, 100).judged();
  EXPECT_EQ(noise.shift(), 1);
  EXPECT_EQ(noise.turn(), 1);
}

TEST(PoseNoiseTest, FewPosesAreNotBelievedToBeBetterThanTheyAre) {
  int believed = 0;
  constexpr int kTrials = 200;
  for (unsigned seed = 1; seed <= kTrials; ++seed) {
    believed += Trial(seed, 1, 1, 1).judged().shift() < 1.0 / 16 ? 1 : 0;
  }
  EXPECT_LE(believed, kTrials / 20);
}

TEST(PoseNoiseTest, ImagesThatTellNothingLeaveWhatIsStated) {
  PoseEvidence evidence;
  evidence.images = PosesMatrix::Zero(12, 12);
  evidence.prior = PosesMatrix::Identity(12, 12);
  evidence.gradient = PosesVector::Zero(12);
  PoseNoise noise;
  EXPECT_TRUE(noise.judge(evidence));
  EXPECT_EQ(noise.shift(), 1);
  EXPECT_EQ(noise.turn(), 1);
}

}  // namespace
}  // namespace vantage
