#include "offboard/experiment/view_chooser.h"

#include <algorithm>
#include <array>
#include <bit>

#include "calib/files/input_error.h"
#include "offboard/experiment/view_set_planner.h"
#include "offboard/gain/view_gain.h"
#include "offboard/planning/utility.h"

namespace vantage {
namespace {

constexpr int kRayColumns = 80, kRayRows = 60;  // rank views as every pixel would
constexpr std::array<Formulation, 8> kPaperFormulations = {Formulation::kOcclusionAware, Formulation::kUnobservedVoxel,
                                                           Formulation::kRearSideVoxel,  Formulation::kRearSideEntropy,
                                                           Formulation::kProximityCount, Formulation::kCombined,
                                                           Formulation::kAverageEntropy, Formulation::kAreaFactor};

/// Steele, Lea and Flood, "Fast splittable pseudorandom number generators", 2014: the same numbers everywhere.
std::uint64_t split_mix(std::uint64_t* state) {
  std::uint64_t z = *state += 0x9e3779b97f4a7c15;
  z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9;
  z = (z ^ z >> 27) * 0x94d049bb133111eb;
  return z ^ z >> 31;
}

double distance(const Choice& choice, std::size_t i) {
  return (choice.open[i].T_world_camera.translation() - choice.position).norm();
}

/// The paper's decision: Eqs. 11 and 12 over one formulation.
class GainChooser : public ViewChooser {
 public:
  GainChooser(Formulation formulation, double cost_weight) : formulation_(formulation), cost_weight_(cost_weight) {}

  std::size_t choose(const Choice& choice) override {
    const RayBundle rays(choice.camera, kRayColumns, kRayRows);
    std::vector<Eigen::Isometry3d> poses;
    for (const CandidateView& view : choice.open) poses.push_back(view.T_world_camera);
    const std::vector<ViewGain> gains = evaluate_views(choice.map, rays, poses);
    std::vector<ScoredView> scores;
    for (std::size_t i = 0; i < poses.size(); ++i) {
      scores.push_back({choice.open[i].id, gains[i][formulation_], distance(choice, i), 0});
    }
    compute_utilities(&scores);
    double costs = 0;
    for (const ScoredView& view : scores) costs += view.cost;
    if (cost_weight_ != 1 && costs > 0) {
      for (ScoredView& view : scores) view.utility += (1 - cost_weight_) * view.cost / costs;
    }
    return *next_best_view(scores);
  }

 private:
  Formulation formulation_;
  double cost_weight_;
};

class RandomChooser : public ViewChooser {
 public:
  explicit RandomChooser(std::uint64_t seed) : state_(seed) {}
  std::size_t choose(const Choice& choice) override { return split_mix(&state_) % choice.open.size(); }

 private:
  std::uint64_t state_;
};

class SequentialChooser : public ViewChooser {
 public:
  std::size_t choose(const Choice& choice) override {
    const auto next = std::find_if(choice.open.begin(), choice.open.end(),
                                   [&](const CandidateView& view) { return view.id > choice.visited.back(); });
    return next == choice.open.end() ? 0 : static_cast<std::size_t>(next - choice.open.begin());
  }
};

class OracleChooser : public ViewChooser {
 public:
  explicit OracleChooser(const TrueCoverage& truth) : truth_(truth) {}

  std::size_t choose(const Choice& choice) override {
    std::vector<std::uint64_t> covered(truth_.covered.front().size());
    for (const std::int64_t id : choice.visited) {
      const std::vector<std::uint64_t>& view = covered_by(id);
      for (std::size_t w = 0; w < covered.size(); ++w) covered[w] |= view[w];
    }
    std::vector<ScoredView> scores;  // ties go to the lower cost, then to the lower id
    for (std::size_t i = 0; i < choice.open.size(); ++i) {
      const std::vector<std::uint64_t>& view = covered_by(choice.open[i].id);
      int gain = 0;
      for (std::size_t w = 0; w < covered.size(); ++w) gain += std::popcount(view[w] & ~covered[w]);
      scores.push_back({choice.open[i].id, 0, distance(choice, i), static_cast<double>(gain)});
    }
    return *next_best_view(scores);
  }

 private:
  const std::vector<std::uint64_t>& covered_by(std::int64_t id) const {
    const auto found = std::find(truth_.view_ids.begin(), truth_.view_ids.end(), id);
    return truth_.covered[static_cast<std::size_t>(found - truth_.view_ids.begin())];
  }

  const TrueCoverage& truth_;
};

std::string joined(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

}  // namespace

const std::vector<std::string>& method_names() {
  static const std::vector<std::string> kNames = [] {
    std::vector<std::string> names;
    for (const Formulation formulation : kPaperFormulations) names.emplace_back(name_of(formulation));
    for (const char* name : {"random", "sequential", "oracle", "view_set"}) names.emplace_back(name);
    return names;
  }();
  return kNames;
}

bool is_paper_method(std::string_view method) {
  return std::any_of(kPaperFormulations.begin(), kPaperFormulations.end(),
                     [&](Formulation formulation) { return name_of(formulation) == method; });
}

std::vector<std::string> parse_methods(const std::vector<std::string>& names) {
  for (const std::string& name : names) {
    const auto& known = method_names();
    if (name != "all" && name != "paper" && std::find(known.begin(), known.end(), name) == known.end()) {
      throw InputError("--methods " + name + ": there are " + joined(known) + ", paper (the first eight), all");
    }
  }
  std::vector<std::string> chosen;
  for (const std::string& method : method_names()) {
    const bool wanted = std::any_of(names.begin(), names.end(), [&](const std::string& name) {
      return name == method || name == "all" || (name == "paper" && is_paper_method(method));
    });
    if (wanted) chosen.push_back(method);
  }
  if (chosen.empty()) throw InputError("--methods: names no method; there are " + joined(method_names()));
  return chosen;
}

std::unique_ptr<ViewChooser> make_chooser(const std::string& method, std::uint64_t seed, const TrueCoverage& truth,
                                          double cost_weight) {
  if (method == "random") return std::make_unique<RandomChooser>(seed);
  if (method == "sequential") return std::make_unique<SequentialChooser>();
  if (method == "oracle") return std::make_unique<OracleChooser>(truth);
  if (method == "view_set") return std::make_unique<ViewSetPlanner>();
  return std::make_unique<GainChooser>(parse_formulation(method).value(), cost_weight);
}

std::int64_t first_view_of_seed(std::uint64_t seed, std::size_t views) {
  if (seed == 1) return 0;
  std::uint64_t state = seed;
  return static_cast<std::int64_t>(split_mix(&state) % views);
}

}  // namespace vantage
