#include "offboard/gain/formulation.h"

#include <cmath>

namespace vantage {
namespace {

constexpr std::array<std::string_view, kFormulations> kNames = {
    "entropy",         "occlusion_aware", "unobserved_voxel", "rear_side_voxel", "rear_side_entropy",
    "proximity_count", "combined",        "average_entropy",  "area_factor"};

}  // namespace

std::string_view name_of(Formulation formulation) { return kNames[static_cast<std::size_t>(formulation)]; }

std::optional<Formulation> parse_formulation(std::string_view name, std::string* why) {
  for (const Formulation formulation : kAllFormulations) {
    if (name == name_of(formulation)) return formulation;
  }
  if (why != nullptr) {
    *why = "no formulation is called \"" + std::string(name) + "\"; there are";
    for (std::size_t i = 0; i < kNames.size(); ++i) *why += (i == 0 ? " " : ", ") + std::string(kNames[i]);
  }
  return std::nullopt;
}

bool needs_marks(Formulation formulation) {
  return formulation == Formulation::kProximityCount || formulation == Formulation::kAreaFactor;
}

CombinedWeights CombinedWeights::robot() {
  CombinedWeights weights;
  weights.weight.fill(0);
  weights[Formulation::kOcclusionAware] = 1;
  weights[Formulation::kUnobservedVoxel] = 20;
  weights[Formulation::kRearSideVoxel] = 10;
  weights[Formulation::kRearSideEntropy] = 10;
  return weights;
}

bool CombinedWeights::valid(std::string* why) const {
  bool positive = false;
  for (const Formulation formulation : kAllFormulations) {
    const double w = (*this)[formulation];
    if (!(std::isfinite(w) && w >= 0)) {
      if (why != nullptr)
        *why = "the weight of " + std::string(name_of(formulation)) + " must be finite and not negative";
      return false;
    }
    positive |= w > 0;
  }
  if ((*this)[Formulation::kCombined] != 0) {
    if (why != nullptr) *why = "combined can't have a weight in itself";
    return false;
  }
  if (!positive && why != nullptr) *why = "combined needs at least one positive weight";
  return positive;
}

double area_factor(double alpha, double alpha_des) {
  const double a = alpha, d = alpha_des;
  if (a <= d) return -2 / (d * d * d) * a * a * a + 3 / (d * d) * a * a;  // h1, Eq. 20
  const double c = (d - 1) * (d - 1) * (d - 1);
  return (-2 * a * a * a + 3 * (d + 1) * a * a - 6 * d * a + (3 * d - 1)) / c;  // h2, Eq. 21
}

}  // namespace vantage
