#include "offboard/gain/formulation.h"

#include <gtest/gtest.h>

namespace vantage {
namespace {

TEST(Formulation, NamesArePapersAndParseBack) {
  const std::vector<std::string> names = {"entropy",         "occlusion_aware",   "unobserved_voxel",
                                          "rear_side_voxel", "rear_side_entropy", "proximity_count",
                                          "combined",        "average_entropy",   "area_factor"};
  ASSERT_EQ(names.size(), kAllFormulations.size());
  for (const std::string& name : names) {
    const auto formulation = parse_formulation(name);
    ASSERT_TRUE(formulation.has_value()) << name;
    EXPECT_EQ(name_of(*formulation), name);
  }
}

TEST(Formulation, AnUnknownNameIsAnsweredWithTheAllowedOnes) {
  std::string why;
  EXPECT_FALSE(parse_formulation("rear-side-voxel", &why).has_value());
  EXPECT_NE(why.find("rear-side-voxel"), std::string::npos);
  for (const Formulation formulation : kAllFormulations) {
    EXPECT_NE(why.find(name_of(formulation)), std::string::npos) << name_of(formulation);
  }
}

TEST(Formulation, AreaFactorMeetsEquations19To21) {
  for (const double wanted : {0.2, 0.8}) {
    EXPECT_NEAR(area_factor(wanted, wanted), 1, 1e-12);
    EXPECT_NEAR(area_factor(wanted + 1e-9, wanted), 1, 1e-6);  // both branches meet
    EXPECT_NEAR(area_factor(0, wanted), 0, 1e-12);
    EXPECT_NEAR(area_factor(1, wanted), 0, 1e-12);
    double before = 0;
    for (double a = 0; a <= 1; a += 0.01) {
      const double value = area_factor(a, wanted);
      EXPECT_GE(value, -1e-12);
      EXPECT_LE(value, 1 + 1e-12);
      const bool rising = a > 0 && a <= wanted, falling = a > wanted + 0.01;
      EXPECT_FALSE(rising && value < before) << a;
      EXPECT_FALSE(falling && value > before) << a;
      before = value;
    }
  }
  // h1(0.1; 0.2) = -2/0.008 0.001 + 3/0.04 0.01 = 0.5; h2 by hand at (0.6; 0.2):
  // (-2 0.216 + 3 1.2 0.36 - 6 0.2 0.6 + (0.6 - 1)) / (-0.512) = (-0.432 + 1.296 - 0.72 - 0.4) / -0.512 = 0.5
  EXPECT_NEAR(area_factor(0.1, 0.2), 0.5, 1e-12);
  EXPECT_NEAR(area_factor(0.6, 0.2), 0.5, 1e-12);
}

TEST(Formulation, CombinedWeightsAreTheSimulationsAndTheRobots) {
  const CombinedWeights simulation;
  EXPECT_EQ(simulation[Formulation::kAverageEntropy], 30);
  EXPECT_EQ(simulation[Formulation::kRearSideEntropy], 1);
  EXPECT_EQ(simulation[Formulation::kOcclusionAware], 0);
  const CombinedWeights robot = CombinedWeights::robot();
  EXPECT_EQ(robot[Formulation::kOcclusionAware], 1);
  EXPECT_EQ(robot[Formulation::kUnobservedVoxel], 20);
  EXPECT_EQ(robot[Formulation::kRearSideVoxel], 10);
  EXPECT_EQ(robot[Formulation::kRearSideEntropy], 10);
  EXPECT_EQ(robot[Formulation::kAverageEntropy], 0);
}

TEST(Formulation, BadWeightsAreNamed) {
  std::string why;
  CombinedWeights weights;
  EXPECT_TRUE(weights.valid(&why));
  weights[Formulation::kEntropy] = -1;
  EXPECT_FALSE(weights.valid(&why));
  EXPECT_NE(why.find("entropy"), std::string::npos);
  weights = CombinedWeights();
  weights[Formulation::kCombined] = 1;
  EXPECT_FALSE(weights.valid(&why));
  weights.weight.fill(0);
  EXPECT_FALSE(weights.valid(&why));
}

}  // namespace
}  // namespace vantage
