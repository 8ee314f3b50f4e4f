#include "offboard/experiment/methods.h"

#include <algorithm>
#include <array>
#include <bit>
#include <utility>

#include "calib/files/input_error.h"
#include "offboard/experiment/split_mix.h"
#include "offboard/lookahead/view_set_planner.h"
#include "offboard/planning/utility.h"

namespace vantage {
namespace {

constexpr std::array<Formulation, 8> kPaperFormulations = {Formulation::kOcclusionAware, Formulation::kUnobservedVoxel,
                                                           Formulation::kRearSideVoxel,  Formulation::kRearSideEntropy,
                                                           Formulation::kProximityCount, Formulation::kCombined,
                                                           Formulation::kAverageEntropy, Formulation::kAreaFactor};

std::unique_ptr<ViewChooser> by_gain(Formulation formulation, const ChooserOptions& options,
                                     const CombinedWeights& weights = {}) {
  GainOptions gain;
  gain.weights = weights;
  return std::make_unique<UtilityChooser>(gain_of(formulation, options.ray_columns, options.ray_rows, gain),
                                          options.cost_weight);
}

class NearestChooser : public ViewChooser {
 public:
  explicit NearestChooser(ChooserOptions options) : options_(std::move(options)) {}

  ChosenView choose(const Choice& choice) override {
    if (!chooser_) chooser_ = by_gain(Formulation::kCombined, options_, options_.learned->nearest(choice.map));
    return chooser_->choose(choice);
  }

 private:
  ChooserOptions options_;
  std::unique_ptr<ViewChooser> chooser_;  // from the first choice on
};

class RandomChooser : public ViewChooser {
 public:
  explicit RandomChooser(std::uint64_t seed) : random_(seed) {}
  ChosenView choose(const Choice& choice) override { return {random_.next() % choice.open.size(), {}, "at random"}; }

 private:
  SplitMix random_;
};

class SequentialChooser : public ViewChooser {
 public:
  ChosenView choose(const Choice& choice) override {
    const auto next = std::find_if(choice.open.begin(), choice.open.end(),
                                   [&](const CandidateView& view) { return view.id > choice.visited.back(); });
    return {next == choice.open.end() ? 0 : static_cast<std::size_t>(next - choice.open.begin()), {}, "the next one"};
  }
};

class OracleChooser : public ViewChooser {
 public:
  explicit OracleChooser(const TrueCoverage& truth) : truth_(truth) {}

  ChosenView choose(const Choice& choice) override {
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
      const double way_m = (choice.open[i].T_world_camera.translation() - choice.position()).norm();
      scores.push_back({choice.open[i].id, 0, way_m, static_cast<double>(gain)});
    }
    return {*next_best_view(scores), {}, "covers most"};
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
    for (const char* name :
         {"random", "sequential", "oracle", "view_set", "view_set_known", "combined_learned", "combined_nearest"})
      names.emplace_back(name);
    return names;
  }();
  return kNames;
}

bool is_paper_method(std::string_view method) {
  return std::any_of(kPaperFormulations.begin(), kPaperFormulations.end(),
                     [&](Formulation formulation) { return name_of(formulation) == method; });
}

bool needs_learned_weights(std::string_view method) {
  return method == "combined_learned" || method == "combined_nearest";
}

std::vector<std::string> parse_methods(const std::vector<std::string>& names, bool learned) {
  for (const std::string& name : names) {
    const auto& known = method_names();
    if (name != "all" && name != "paper" && std::find(known.begin(), known.end(), name) == known.end()) {
      throw InputError("--methods " + name + ": there are " + joined(known) + ", paper (the first eight), all");
    }
    if (needs_learned_weights(name) && !learned) {
      throw InputError("--methods " + name + ": needs --weights FILE, which vantage-experiment tune writes");
    }
  }
  std::vector<std::string> chosen;
  for (const std::string& method : method_names()) {
    const bool wanted = std::any_of(names.begin(), names.end(), [&](const std::string& name) {
      return name == method || (name == "all" && (learned || !needs_learned_weights(method))) ||
             (name == "paper" && is_paper_method(method));
    });
    if (wanted) chosen.push_back(method);
  }
  if (chosen.empty()) throw InputError("--methods: names no method; there are " + joined(method_names()));
  return chosen;
}

double known_share_of(std::string_view method, const ChooserOptions& options) {
  return method == "view_set_known" ? options.known_share : 0;
}

std::unique_ptr<ViewChooser> make_chooser(const std::string& method, std::uint64_t seed, const TrueCoverage& truth,
                                          const ChooserOptions& options) {
  if (method == "random") return std::make_unique<RandomChooser>(seed);
  if (method == "sequential") return std::make_unique<SequentialChooser>();
  if (method == "oracle") return std::make_unique<OracleChooser>(truth);
  if (method == "combined_learned") return by_gain(Formulation::kCombined, options, options.learned->all());
  if (method == "combined_nearest") return std::make_unique<NearestChooser>(options);
  if (method == "view_set" || method == "view_set_known") return std::make_unique<ViewSetPlanner>();
  return by_gain(parse_formulation(method).value(), options);
}

std::int64_t first_view_of_seed(std::uint64_t seed, std::size_t views) {
  if (seed == 1) return 0;
  return static_cast<std::int64_t>(SplitMix(seed).next() % views);
}

}  // namespace vantage
