// vantage-experiment: the paper's simulated evaluation in one process. docs/experiment.md.

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <exception>
#include <iostream>
#include <thread>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <signal.h>

#include "calib/files/input_error.h"
#include "calib/program.h"
#include "offboard/experiment/experiment.h"
#include "offboard/experiment/report.h"

namespace vantage {
namespace {

std::atomic<bool> interrupted = false;  // set by the signal handler alone

struct Arguments {
  std::vector<std::string> objects{"teapot", "bunny", "dragon"};
  std::vector<std::string> methods{"all"};
  std::string models = "models";
  ExperimentOptions options;
  int seeds = 1;
  int threads = 0;
  std::string shard = "1/1";
  std::string out;
  std::vector<std::string> parts;
  bool resume = false, overwrite = false;
};

StoreStart start_of(const Arguments& arguments) {
  if (arguments.overwrite) return StoreStart::kOverwrite;
  return arguments.resume ? StoreStart::kResume : StoreStart::kNew;
}

/// Tables and report of what the store holds, and where they are.
void finish(const RunStore& store) {
  const std::vector<MethodRun> runs = store.read();
  write_tables(store.folder(), runs);
  write_report(store, runs);
  std::cout << runs.size() << " runs: " << store.folder().string() << "/summary.csv, report.html" << std::endl;
}

int run(const Arguments& arguments) {
  const Shard shard = Shard::parse(arguments.shard);
  const std::vector<std::string> methods = parse_methods(arguments.methods);
  const std::vector<ExperimentObject> objects = load_objects(arguments.objects, arguments.models);
  StoreSettings settings;
  settings.views = arguments.options.views;
  settings.cost_weight = arguments.options.cost_weight;
  for (const ExperimentObject& object : objects) settings.objects.push_back({object.name, object.digest});
  const RunStore store(arguments.out, settings, start_of(arguments));

  const auto cores = static_cast<int>(std::thread::hardware_concurrency());
  const int threads = arguments.threads > 0 ? arguments.threads : std::max(1, cores);
  const std::vector<RunKey> runs = shard_of(list_runs(objects, methods, arguments.seeds), shard);
  const bool whole = run_experiment(objects, runs, arguments.options, threads, store, interrupted, std::cout);
  finish(store);
  if (whole) return kExitOk;
  fmt::print(stderr, "vantage-experiment: interrupted; the same command with --resume goes on\n");
  return kExitFailure;
}

int merge(const Arguments& arguments) {
  const std::vector<std::filesystem::path> parts(arguments.parts.begin(), arguments.parts.end());
  finish(merge_stores(parts, arguments.out, start_of(arguments)));
  return kExitOk;
}

void declare_out(CLI::App* command, Arguments* arguments) {
  command->add_option("--out", arguments->out, "folder of the experiment")->required();
  auto* resume = command->add_flag("--resume", arguments->resume, "add to what the folder holds");
  command->add_flag("--overwrite", arguments->overwrite, "replace what the folder holds")->excludes(resume);
}

}  // namespace
}  // namespace vantage

int main(int argc, char** argv) {
  using namespace vantage;
  CLI::App app("The paper's simulated evaluation: objects x methods x seeds, in one process.", "vantage-experiment");
  app.set_version_flag("--version", VANTAGE_VERSION);
  app.require_subcommand(1);
  Arguments arguments;

  CLI::App* run_command = app.add_subcommand("run", "reconstruct objects by several methods and compare them");
  run_command->add_option("--objects", arguments.objects, "teapot, bunny, dragon, or mesh files")
      ->delimiter(',')
      ->capture_default_str();
  run_command->add_option("--methods", arguments.methods, "names (see docs/experiment.md), paper, or all")
      ->delimiter(',')
      ->capture_default_str();
  run_command->add_option("--views", arguments.options.views, "of a run")
      ->check(CLI::Range(1, 48))
      ->capture_default_str();
  run_command->add_option("--seeds", arguments.seeds, "seeds 1 to K, of noise, texture and first view")
      ->check(CLI::Range(1, 10'000))
      ->capture_default_str();
  run_command
      ->add_option("--cost-weight", arguments.options.cost_weight, "of movement in Eq. 11, for the paper's methods")
      ->check(CLI::Range(0.0, 1000.0))
      ->capture_default_str();
  run_command->add_option("--shard", arguments.shard, "the i-th of n parts, i/n")->capture_default_str();
  run_command->add_option("--threads", arguments.threads, "0: one a core; does not change the result")
      ->check(CLI::Range(0, 256))
      ->capture_default_str();
  run_command->add_option("--models", arguments.models, "folder of teapot, bunny and dragon")->capture_default_str();
  declare_out(run_command, &arguments);

  CLI::App* merge_command = app.add_subcommand("merge", "put the shards of an experiment together");
  merge_command->add_option("parts", arguments.parts, "folders of the shards")->required();
  declare_out(merge_command, &arguments);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kExitOk : kExitBadInput;
  }
  struct sigaction action {};
  action.sa_handler = [](int) { interrupted = true; };
  ::sigaction(SIGINT, &action, nullptr);
  ::sigaction(SIGTERM, &action, nullptr);
  return run_program("vantage-experiment", [&] { return *run_command ? run(arguments) : merge(arguments); });
}
