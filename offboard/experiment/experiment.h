#pragma once

#include <atomic>
#include <cstdint>
#include <iosfwd>
#include <string>
#include <vector>

#include "offboard/experiment/experiment_object.h"
#include "offboard/experiment/method_run.h"
#include "offboard/experiment/run_store.h"

namespace vantage {

/// One part of an experiment that several programs share.
struct Shard {
  int index = 1, count = 1;  ///< 1 <= index <= count

  /// "2/8". \throws InputError for anything else.
  static Shard parse(const std::string& text);
};

/// All runs of objects × seeds × methods in that order: what needs the same depth maps stands together.
std::vector<RunKey> list_runs(const std::vector<ExperimentObject>& objects, const std::vector<std::string>& methods,
                              int seeds);

/// A shard's runs: an equal share of the list, unbroken. The shards together hold each run once.
std::vector<RunKey> shard_of(const std::vector<RunKey>& all, const Shard& shard);

/// Makes the runs that the store does not hold, `threads` at a time. A line a run goes to `terminal`, with the time
/// left; the tables are written after each scene. False when `stop` was set before the end: what is finished is in the
/// store.
bool run_experiment(const std::vector<ExperimentObject>& objects, const std::vector<RunKey>& runs,
                    const ExperimentOptions& options, int threads, const RunStore& store, const std::atomic<bool>& stop,
                    std::ostream& terminal);

}  // namespace vantage
