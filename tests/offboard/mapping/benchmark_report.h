#pragma once

#include <algorithm>
#include <cstdio>
#include <map>
#include <string>
#include <vector>

#include <benchmark/benchmark.h>

namespace vantage {

/// The usual table, and afterwards the best time of each benchmark, for the ratios that a program prints as
/// "name value" lines. The best of several repetitions: on a shared machine every disturbance is a delay.
class BenchmarkReport : public benchmark::ConsoleReporter {
 public:
  BenchmarkReport() : ConsoleReporter(OO_Tabular) {}

  void ReportRuns(const std::vector<Run>& runs) override {
    ConsoleReporter::ReportRuns(runs);
    for (const Run& run : runs) {
      if (run.run_type != Run::RT_Iteration || run.error_occurred) continue;
      const auto visits = run.counters.find("visits");
      if (visits != run.counters.end()) counters_[run.run_name.function_name] = visits->second.value;
      const double iterations = static_cast<double>(run.iterations);
      keep(&cpu_, run.run_name.function_name, run.cpu_accumulated_time / iterations);
      keep(&real_, run.run_name.function_name, run.real_accumulated_time / iterations);
    }
  }

  /// Seconds of an iteration, 0 when the benchmark did not run.
  double cpu(const std::string& name) const { return find(cpu_, name); }
  double real(const std::string& name) const { return find(real_, name); }

  /// The benchmark's counter "visits".
  double counter(const std::string& name) const { return find(counters_, name); }

  /// Prints a figure, unless what it is made of did not run.
  static void print(const char* name, double numerator, double denominator) {
    if (numerator > 0 && denominator > 0) std::printf("%s %.3f\n", name, numerator / denominator);
  }

 private:
  using Times = std::map<std::string, double>;

  static void keep(Times* times, const std::string& name, double seconds) {
    const auto [entry, fresh] = times->try_emplace(name, seconds);
    if (!fresh) entry->second = std::min(entry->second, seconds);
  }
  static double find(const Times& times, const std::string& name) {
    const auto found = times.find(name);
    return found == times.end() ? 0 : found->second;
  }

  Times cpu_, real_, counters_;
};

}  // namespace vantage
