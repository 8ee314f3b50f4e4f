#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>

namespace vantage {

/// The information gain formulations of the paper, by the names that command line and configuration use.
enum class Formulation {
  kEntropy,          ///< entropy: Eq. 2
  kOcclusionAware,   ///< occlusion_aware: Eqs. 3, 4
  kUnobservedVoxel,  ///< unobserved_voxel: Eqs. 5, 6
  kRearSideVoxel,    ///< rear_side_voxel: Eq. 7
  kRearSideEntropy,  ///< rear_side_entropy: Eq. 8
  kProximityCount,   ///< proximity_count: Eq. 9
  kCombined,         ///< combined: Eq. 10
  kAverageEntropy,   ///< average_entropy: Eq. 17 (Kriegel)
  kAreaFactor        ///< area_factor: Eqs. 18-21 (Vasquez-Gomez)
};
constexpr int kFormulations = 9;
constexpr std::array<Formulation, kFormulations> kAllFormulations = {
    Formulation::kEntropy,       Formulation::kOcclusionAware,  Formulation::kUnobservedVoxel,
    Formulation::kRearSideVoxel, Formulation::kRearSideEntropy, Formulation::kProximityCount,
    Formulation::kCombined,      Formulation::kAverageEntropy,  Formulation::kAreaFactor};

std::string_view name_of(Formulation formulation);

/// The formulation of that name; none, with the allowed names in `why`, when there is none.
std::optional<Formulation> parse_formulation(std::string_view name, std::string* why = nullptr);

/// True for the formulations that have nothing to count in a map without occlusion marks.
bool needs_marks(Formulation formulation);

/// Weights w_h of the combined formulation (Eq. 10); `combined` itself has none. The defaults are the simulation's.
struct CombinedWeights {
  std::array<double, kFormulations> weight{};

  CombinedWeights() {
    (*this)[Formulation::kAverageEntropy] = 30;
    (*this)[Formulation::kRearSideEntropy] = 1;
  }
  double& operator[](Formulation f) { return weight[static_cast<std::size_t>(f)]; }
  double operator[](Formulation f) const { return weight[static_cast<std::size_t>(f)]; }

  /// The robot's weights (Section IV-B).
  static CombinedWeights robot();

  /// False, with the reason in `why`: a weight that is not finite or negative, one for `combined`, none positive.
  bool valid(std::string* why = nullptr) const;
};

/// f(alpha, alpha_des) of Eqs. 19-21, for shares in [0, 1]: 1 at alpha_des, 0 at 0 and 1.
double area_factor(double alpha, double alpha_des);

}  // namespace vantage
