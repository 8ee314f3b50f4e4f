// vantage-experiment: the paper's simulated evaluation in one process. docs/experiment.md.

#include <algorithm>
#include <atomic>
#include <charconv>
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
#include "offboard/experiment/learning_states.h"
#include "offboard/experiment/procedural_shape.h"
#include "offboard/experiment/report.h"
#include "offboard/experiment/tune.h"

namespace vantage {
namespace {

constexpr int kTunedViews = 12;  // area_2_12 looks no further

std::atomic<bool> interrupted = false;  // set by the signal handler alone

struct Arguments {
  std::vector<std::string> objects{"teapot", "bunny", "dragon"};
  std::vector<std::string> methods{"all"};
  std::string models = "models";
  ExperimentOptions options;
  std::string rays = "80x60", clamp = "0.03,0.97";
  std::string weights;
  std::string cache;
  int first_shape = 1, shapes = 12;
  TuneOptions tune;
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

int threads_of(const Arguments& arguments) {
  const auto cores = static_cast<int>(std::thread::hardware_concurrency());
  return arguments.threads > 0 ? arguments.threads : std::max(1, cores);
}

/// Tables and report of what the store holds, and where they are.
void finish(const RunStore& store) {
  const std::vector<MethodRun> runs = store.read();
  write_tables(store.folder(), runs);
  write_report(store, runs);
  std::cout << runs.size() << " runs: " << store.folder().string() << "/summary.csv, means.csv, report.html"
            << std::endl;
}

/// Two numbers with a separator between them. \throws InputError, which starts with `option`, for anything else.
template <typename Number>
void parse_two(const std::string& option, const std::string& text, char separator, const char* example, Number* first,
               Number* second) {
  const char* const end = text.data() + text.size();
  const auto one = std::from_chars(text.data(), end, *first);
  if (one.ec == std::errc() && one.ptr != end && *one.ptr == separator) {
    const auto two = std::from_chars(one.ptr + 1, end, *second);
    if (two.ec == std::errc() && two.ptr == end) return;
  }
  throw InputError(fmt::format("{} {}: expected e.g. {}", option, text, example));
}

ExperimentOptions options_of(const Arguments& arguments) {
  ExperimentOptions options = arguments.options;
  parse_two("--rays", arguments.rays, 'x', "80x60", &options.choosing.ray_columns, &options.choosing.ray_rows);
  for (const int rays : {options.choosing.ray_columns, options.choosing.ray_rows}) {
    if (rays < 1 || rays > 4096) throw InputError("--rays " + arguments.rays + ": each must lie between 1 and 4096");
  }
  parse_two("--clamp", arguments.clamp, ',', "0.12,0.97", &options.clamp_min, &options.clamp_max);
  std::string why;
  if (!sensor_of(options).valid(&why)) throw InputError("--clamp " + arguments.clamp + ": " + why);
  if (!arguments.weights.empty()) {
    options.choosing.learned = std::make_shared<const LearnedWeights>(LearnedWeights::load(arguments.weights));
  }
  return options;
}

int run(const Arguments& arguments) {
  const Shard shard = Shard::parse(arguments.shard);
  const ExperimentOptions options = options_of(arguments);
  const std::vector<std::string> methods = parse_methods(arguments.methods, options.choosing.learned != nullptr);
  const std::vector<ExperimentObject> objects = load_objects(arguments.objects, arguments.models);
  StoreSettings settings;
  settings.views = options.views;
  settings.cost_weight = options.choosing.cost_weight;
  settings.ray_columns = options.choosing.ray_columns;
  settings.ray_rows = options.choosing.ray_rows;
  settings.clamp_min = options.clamp_min;
  settings.clamp_max = options.clamp_max;
  settings.view_radius_m = options.view_radius_m;
  settings.most_way_m = options.most_way_m;
  settings.known_share = options.choosing.known_share;
  if (!arguments.weights.empty()) settings.weights = digest_of_file(arguments.weights);
  for (const ExperimentObject& object : objects) settings.objects.push_back({object.name, object.digest});
  RunStore store(arguments.out, settings, start_of(arguments));
  if (!arguments.cache.empty()) store.keep_views_in(arguments.cache);

  const std::vector<RunKey> runs = shard_of(list_runs(objects, methods, arguments.seeds), shard);
  const bool whole = run_experiment(objects, runs, options, threads_of(arguments), store, interrupted, std::cout);
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

int tune(const Arguments& arguments) {
  const std::filesystem::path out = arguments.out, log = arguments.out + ".log";
  TuneOptions options = arguments.tune;
  options.run = options_of(arguments);
  options.run.views = kTunedViews;
  options.search.threads = threads_of(arguments);
  options.cache = arguments.cache;
  if (arguments.overwrite) {
    std::filesystem::remove(log);
  } else if (std::filesystem::exists(out)) {
    throw InputError(out.string() + ": is there already; add --overwrite to replace it");
  } else if (std::filesystem::exists(log) && !arguments.resume) {
    throw InputError(log.string() + ": a search was begun; add --resume to go on, or --overwrite to begin anew");
  }
  const std::vector<ExperimentObject> objects = load_objects(arguments.objects, arguments.models);
  const std::optional<LearnedWeights> learned = tune_weights(objects, options, log, interrupted, std::cout);
  if (!learned) {
    fmt::print(stderr, "vantage-experiment: interrupted; the same command with --resume goes on\n");
    return kExitFailure;
  }
  learned->save(out, describe(objects, options));
  std::filesystem::remove(log);
  std::cout << out.string() << ": weights for " << objects.size() << " objects" << std::endl;
  return kExitOk;
}

int write_states(const Arguments& arguments) {
  LearningStatesOptions options;
  options.scenes.seeds = arguments.seeds;
  options.scenes.threads = threads_of(arguments);
  options.scenes.run = options_of(arguments);
  options.scenes.run.views = kTunedViews;
  options.scenes.cache = arguments.cache;
  const std::vector<ExperimentObject> objects = load_objects(arguments.objects, arguments.models);
  if (write_learning_states(objects, options, arguments.out, interrupted, std::cout)) return kExitOk;
  fmt::print(stderr, "vantage-experiment: interrupted\n");
  return kExitFailure;
}

int write_shapes(const Arguments& arguments) {
  std::error_code error;
  std::filesystem::create_directories(arguments.out, error);
  if (error) throw InputError(arguments.out + ": can't be made: " + error.message());
  for (int i = 0; i < arguments.shapes; ++i) {
    const auto number = static_cast<std::uint64_t>(arguments.first_shape + i);
    const std::filesystem::path file = std::filesystem::path(arguments.out) / fmt::format("shape-{}.ply", number);
    write_ply(file, procedural_shape(number));
    std::cout << file.string() << ": " << name_of(kind_of_shape(number)) << std::endl;
  }
  return kExitOk;
}

void declare_out(CLI::App* command, const char* what, Arguments* arguments) {
  command->add_option("--out", arguments->out, what)->required();
  auto* resume = command->add_flag("--resume", arguments->resume, "go on with what is there");
  command->add_flag("--overwrite", arguments->overwrite, "replace what is there")->excludes(resume);
}

/// What run and tune share.
void declare_scene(CLI::App* command, Arguments* arguments) {
  command->add_option("--objects", arguments->objects, "teapot, bunny, dragon, or mesh files")
      ->delimiter(',')
      ->capture_default_str();
  command
      ->add_option("--cost-weight", arguments->options.choosing.cost_weight,
                   "of movement in Eq. 11, for the paper's methods")
      ->check(CLI::Range(0.0, 1000.0))
      ->capture_default_str();
  command->add_option("--rays", arguments->rays, "that rank a view, columns x rows")->capture_default_str();
  command->add_option("--clamp", arguments->clamp, "of the map's probabilities, least,largest")->capture_default_str();
  command->add_option("--view-radius", arguments->options.view_radius_m, "of the candidates' cylinder, m")
      ->check(CLI::Range(0.3, 1.2))
      ->capture_default_str();
  command->add_option("--threads", arguments->threads, "0: one a core; does not change the result")
      ->check(CLI::Range(0, 256))
      ->capture_default_str();
  command->add_option("--models", arguments->models, "folder of teapot, bunny and dragon")->capture_default_str();
}

CLI::App* declare_run(CLI::App* app, Arguments* arguments) {
  CLI::App* command = app->add_subcommand("run", "reconstruct objects by several methods and compare them");
  declare_scene(command, arguments);
  command->add_option("--methods", arguments->methods, "names (see docs/experiment.md), paper, or all")
      ->delimiter(',')
      ->capture_default_str();
  command->add_option("--views", arguments->options.views, "of a run")->check(CLI::Range(1, 48))->capture_default_str();
  command->add_option("--most-way", arguments->options.most_way_m, "of a run, m; 0: no limit")
      ->check(CLI::Range(0.0, 1000.0))
      ->capture_default_str();
  command
      ->add_option("--known-share", arguments->options.choosing.known_share,
                   "view_set_known ends when no view promises that share of what the best promised at first")
      ->check(CLI::Range(0.0, 1.0))
      ->capture_default_str();
  command->add_option("--seeds", arguments->seeds, "seeds 1 to K, of noise, texture and first view")
      ->check(CLI::Range(1, 10'000))
      ->capture_default_str();
  command->add_option("--weights", arguments->weights, "learned by tune: for combined_learned, combined_nearest");
  command->add_option("--cache", arguments->cache, "folder of rendered views, to share (default: OUT/views)");
  command->add_option("--shard", arguments->shard, "the i-th of n parts, i/n")->capture_default_str();
  declare_out(command, "folder of the experiment", arguments);
  return command;
}

CLI::App* declare_tune(CLI::App* app, Arguments* arguments) {
  CLI::App* command = app->add_subcommand("tune", "learn weights of `combined` on objects");
  declare_scene(command, arguments);
  command->add_option("--seeds", arguments->tune.seeds, "seeds 1 to K of each object")
      ->check(CLI::Range(1, 100))
      ->capture_default_str();
  command
      ->add_option("--evaluations", arguments->tune.search.evaluations, "weights tried on the set, and on each object")
      ->check(CLI::Range(1, 100'000))
      ->capture_default_str();
  command->add_option("--search-seed", arguments->tune.search.seed, "of the search")->capture_default_str();
  command->add_option("--cache", arguments->cache, "folder of rendered views, to share (default: in memory)");
  declare_out(command, "file of the weights", arguments);
  return command;
}

CLI::App* declare_states(CLI::App* app, Arguments* arguments) {
  CLI::App* command =
      app->add_subcommand("states", "write what maps of objects knew, for the surface network to learn");
  declare_scene(command, arguments);
  command->add_option("--seeds", arguments->seeds, "seeds 1 to K of each object")
      ->check(CLI::Range(1, 100))
      ->capture_default_str();
  command->add_option("--cache", arguments->cache, "folder of rendered views, to share (default: in memory)");
  command->add_option("--out", arguments->out, "folder")->required();
  return command;
}

CLI::App* declare_shapes(CLI::App* app, Arguments* arguments) {
  CLI::App* command = app->add_subcommand("shapes", "write procedural objects as shape-N.ply");
  command
      ->add_option(
          "--first", arguments->first_shape,
          "number of the first; from 10000 on of more kinds, stretched, lying on any side, from 20000 on hollow parts")
      ->check(CLI::Range(1, 1'000'000))
      ->capture_default_str();
  command->add_option("--count", arguments->shapes, "how many")->check(CLI::Range(1, 1000))->capture_default_str();
  command->add_option("--out", arguments->out, "folder")->required();
  return command;
}

}  // namespace
}  // namespace vantage

int main(int argc, char** argv) {
  using namespace vantage;
  CLI::App app("The paper's simulated evaluation: objects x methods x seeds, in one process.", "vantage-experiment");
  app.set_version_flag("--version", VANTAGE_VERSION);
  app.require_subcommand(1);
  Arguments arguments;

  const CLI::App* run_command = declare_run(&app, &arguments);
  CLI::App* merge_command = app.add_subcommand("merge", "put the shards of an experiment together");
  merge_command->add_option("parts", arguments.parts, "folders of the shards")->required();
  declare_out(merge_command, "folder of the experiment", &arguments);
  const CLI::App* tune_command = declare_tune(&app, &arguments);
  const CLI::App* states_command = declare_states(&app, &arguments);
  declare_shapes(&app, &arguments);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kExitOk : kExitBadInput;
  }
  struct sigaction action {};
  action.sa_handler = [](int) { interrupted = true; };
  ::sigaction(SIGINT, &action, nullptr);
  ::sigaction(SIGTERM, &action, nullptr);
  return run_program("vantage-experiment", [&] {
    if (*run_command) return run(arguments);
    if (*tune_command) return tune(arguments);
    if (*states_command) return write_states(arguments);
    return *merge_command ? merge(arguments) : write_shapes(arguments);
  });
}
