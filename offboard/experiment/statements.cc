#include "offboard/experiment/statements.h"

#include <algorithm>
#include <optional>

#include <fmt/format.h>

namespace vantage {
namespace {

/// "Each of `group` is better than each other method of the paper."
struct Ordering {
  const char* statement;
  std::vector<std::string> group;
  double MethodMeans::*measure;
  bool larger_is_better;
  const char* format;  // of a value
};

const std::vector<Ordering>& orderings() {
  static const std::vector<Ordering> kOrderings = {
      {"rear_side_voxel, proximity_count and combined lead in coverage per view (area over views 2-12)",
       {"rear_side_voxel", "proximity_count", "combined"},
       &MethodMeans::area_2_12,
       true,
       "{} {:.3f}"},
      {"average_entropy and area_factor lead in entropy reduction (mean entropy over views 2-12, nats)",
       {"average_entropy", "area_factor"},
       &MethodMeans::entropy_2_12,
       false,
       "{} {:.0f}"},
      {"occlusion_aware and unobserved_voxel move least (whole way, m)",
       {"occlusion_aware", "unobserved_voxel"},
       &MethodMeans::motion_m,
       false,
       "{} {:.2f}"},
      {"occlusion_aware and unobserved_voxel cover worst (area over views 2-12)",
       {"occlusion_aware", "unobserved_voxel"},
       &MethodMeans::area_2_12,
       false,
       "{} {:.3f}"},
  };
  return kOrderings;
}

const MethodMeans* find(const std::vector<MethodMeans>& means, const std::string& method) {
  const auto found = std::find_if(means.begin(), means.end(), [&](const MethodMeans& m) { return m.method == method; });
  return found == means.end() ? nullptr : &*found;
}

std::optional<Verdict> judge(const Ordering& ordering, const std::string& object,
                             const std::vector<MethodMeans>& means) {
  const MethodMeans *worst_in = nullptr, *best_out = nullptr;
  const auto better = [&](const MethodMeans& a, const MethodMeans& b) {
    return ordering.larger_is_better ? a.*ordering.measure > b.*ordering.measure
                                     : a.*ordering.measure < b.*ordering.measure;
  };
  for (const std::string& name : method_names()) {
    if (!is_paper_method(name)) continue;
    const MethodMeans* method = find(means, name);
    if (method == nullptr) return std::nullopt;
    const bool in = std::find(ordering.group.begin(), ordering.group.end(), name) != ordering.group.end();
    if (in && (worst_in == nullptr || better(*worst_in, *method))) worst_in = method;
    if (!in && (best_out == nullptr || better(*method, *best_out))) best_out = method;
  }
  const auto value = [&](const MethodMeans& m) {
    return fmt::format(fmt::runtime(ordering.format), m.method, m.*ordering.measure);
  };
  Verdict verdict{ordering.statement, object, better(*worst_in, *best_out), ""};
  verdict.by_how_much = fmt::format("last of them {}, first of the others {}", value(*worst_in), value(*best_out));
  return verdict;
}

/// Ours: what docs/view_set.md promises of `name`, view_set or view_set_known.
void judge_view_set(const std::string& name, const std::string& object, const std::vector<MethodMeans>& means,
                    std::vector<Verdict>* verdicts) {
  const MethodMeans* set = find(means, name);
  if (set == nullptr) return;
  const MethodMeans* best = nullptr;
  for (const MethodMeans& m : means) {
    if (is_paper_method(m.method) && (best == nullptr || m.area_2_12 > best->area_2_12)) best = &m;
  }
  if (best != nullptr) {
    verdicts->push_back({name + " covers more over views 2-12 than the best one-step method, at no more motion", object,
                         set->area_2_12 > best->area_2_12 && set->motion_m <= best->motion_m,
                         fmt::format("{} {:.3f} on {:.2f} m, {} {:.3f} on {:.2f} m", name, set->area_2_12,
                                     set->motion_m, best->method, best->area_2_12, best->motion_m)});
  }
  if (const MethodMeans* oracle = find(means, "oracle"); oracle != nullptr) {
    verdicts->push_back({name + " comes within 0.03 of the oracle (area over views 2-12)", object,
                         set->area_2_12 >= oracle->area_2_12 - 0.03,
                         fmt::format("{} {:.3f}, oracle {:.3f}", name, set->area_2_12, oracle->area_2_12)});
  }
}

/// Learned weights against the paper's, and the nearest object's against those of the whole training set.
void judge_learned(const std::string& object, const std::vector<MethodMeans>& means, std::vector<Verdict>* verdicts) {
  const auto compare = [&](const char* better, const char* than, const char* statement) {
    const MethodMeans *a = find(means, better), *b = find(means, than);
    if (a == nullptr || b == nullptr) return;
    verdicts->push_back({statement, object, a->area_2_12 > b->area_2_12,
                         fmt::format("{} {:.3f} on {:.2f} m, {} {:.3f} on {:.2f} m", better, a->area_2_12, a->motion_m,
                                     than, b->area_2_12, b->motion_m)});
  };
  compare("combined_learned", "combined", "combined covers more over views 2-12 with learned weights than the paper's");
  compare("combined_nearest", "combined_learned",
          "the nearest training object's weights cover more over views 2-12 than those of the whole set");
}

}  // namespace

std::vector<MethodMeans> means_of(const std::vector<MethodRun>& runs, const std::string& object) {
  std::vector<MethodMeans> all;
  for (const std::string& name : method_names()) {
    std::vector<double> area, coverage, entropy, motion, reachable;
    for (const MethodRun& run : runs) {
      if (run.object != object || run.method != name) continue;
      area.push_back(area_2_12(run));
      coverage.push_back(run.steps.back().coverage);
      motion.push_back(run.steps.back().motion_m);
      reachable.push_back(run.reachable);
      double sum = 0;
      int views = 0;
      for (const MethodStep& step : run.steps) {
        if (step.step < 2 || step.step > 12) continue;
        sum += step.entropy_nats;
        ++views;
      }
      entropy.push_back(views == 0 ? 0 : sum / views);
    }
    if (area.empty()) continue;
    MethodMeans means;
    means.method = name;
    means.seeds = static_cast<int>(area.size());
    means.area_interval = mean_interval(area);
    means.coverage_interval = mean_interval(coverage);
    means.motion_interval = mean_interval(motion);
    means.area_2_12 = means.area_interval.mean;
    means.coverage_final = means.coverage_interval.mean;
    means.motion_m = means.motion_interval.mean;
    means.entropy_2_12 = mean_interval(entropy).mean;
    means.reachable = mean_interval(reachable).mean;
    all.push_back(means);
  }
  return all;
}

std::vector<Verdict> judge_statements(const std::vector<MethodRun>& runs, const std::vector<std::string>& objects) {
  std::vector<Verdict> verdicts;
  for (const Ordering& ordering : orderings()) {
    for (const std::string& object : objects) {
      const std::optional<Verdict> verdict = judge(ordering, object, means_of(runs, object));
      if (verdict) verdicts.push_back(*verdict);
    }
  }
  for (const std::string& object : objects) {
    const std::vector<MethodMeans> means = means_of(runs, object);
    for (const char* name : {"view_set", "view_set_known"}) judge_view_set(name, object, means, &verdicts);
    judge_learned(object, means, &verdicts);
  }
  return verdicts;
}

}  // namespace vantage
