#pragma once

#include "offboard/experiment/run_store.h"

namespace vantage {

/// Writes report.html, which needs no other file, and its plots as plots/OBJECT-{coverage,entropy,motion}.svg: the mean
/// of the seeds, with a band from the least to the largest.
/// Beside them means.csv: a line for each object and method, means over the seeds and their intervals (empty for one
/// seed).
void write_report(const RunStore& store, const std::vector<MethodRun>& runs);

}  // namespace vantage
