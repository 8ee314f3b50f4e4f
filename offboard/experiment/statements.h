#pragma once

#include <string>
#include <vector>

#include "offboard/experiment/mean_interval.h"
#include "offboard/experiment/method_run.h"

namespace vantage {

/// Means of a method's runs on one object.
struct MethodMeans {
  std::string method;
  double area_2_12 = 0, coverage_final = 0, entropy_2_12 = 0, motion_m = 0, reachable = 0;
  MeanInterval area_interval, coverage_interval, motion_interval;  ///< of the seeds, around the means above
  int seeds = 0;
};

/// By method_names()' order; those without a run on the object are left out.
std::vector<MethodMeans> means_of(const std::vector<MethodRun>& runs, const std::string& object);

/// A statement held against the runs on one object.
struct Verdict {
  std::string statement, object;
  bool holds = false;
  std::string by_how_much;  ///< the two methods that decide it, and their values
};

/// The paper's statements (paper.md, "outcome to hold against") and ours on view_set and learned weights, by object. A
/// statement whose methods did not all run is left out; so is an object without runs.
std::vector<Verdict> judge_statements(const std::vector<MethodRun>& runs, const std::vector<std::string>& objects);

}  // namespace vantage
