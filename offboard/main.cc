// vantage-offboard: the workstation's program. Depth maps to a map, to gains, to the next best view.

#include <cstdio>
#include <ctime>
#include <iostream>
#include <map>
#include <memory>
#include <optional>

#include <CLI/CLI.hpp>
#include <spdlog/spdlog.h>

#include "calib/files/input_error.h"
#include "calib/program.h"
#include "lcmtypes/link/depth_codec.h"
#include "lcmtypes/link/event_log.h"
#include "lcmtypes/link/network_link.h"
#include "offboard/planner_link.h"
#include "offboard/replay.h"
#include "offboard/session/map_check.h"

namespace vantage {
namespace {

/// What the command line says; what it does not say stays as the configuration has it.
struct Arguments {
  std::optional<std::string> config, views, truth, method, gain;
  std::optional<std::int64_t> first_view, most_views;
  std::optional<double> gain_threshold, gain_share, most_way_m;
  bool no_planning = false;
  std::string session;
  bool overwrite = false;
  std::string resume;
  NetworkOptions network;
  OnLostRobot on_lost_robot = OnLostRobot::kEnd;
  std::string replay;
  double speed = 1;
  std::string hold_out;
};

std::string default_session_folder() {
  std::time_t now = std::time(nullptr);
  std::tm local{};
  ::localtime_r(&now, &local);
  char name[40];
  std::strftime(name, sizeof name, "sessions/%Y%m%d-%H%M%S", &local);
  return name;
}

void apply(const Arguments& arguments, SessionConfig* config) {
  if (arguments.truth) config->truth = *arguments.truth;
  if (arguments.no_planning) config->planning.reset();
  const bool about_planning = arguments.views || arguments.method || arguments.gain || arguments.first_view ||
                              arguments.most_views || arguments.gain_threshold || arguments.gain_share ||
                              arguments.most_way_m;
  if (!about_planning) return;
  if (!config->planning) throw InputError("--views, --method and the like: this session plans no views");
  PlanningConfig& planning = *config->planning;
  if (arguments.views) planning.views = *arguments.views;
  if (arguments.first_view) planning.planner.first_view = *arguments.first_view;
  if (arguments.most_views) planning.planner.most_views = *arguments.most_views;
  if (arguments.gain_threshold) planning.planner.enough.gain = *arguments.gain_threshold;
  if (arguments.gain_share) planning.planner.enough.share = *arguments.gain_share;
  if (arguments.most_way_m) planning.planner.most_way_m = *arguments.most_way_m;
  if (arguments.method) {
    std::string why;
    const std::optional<PlanningMethod> method = parse_planning_method(*arguments.method, &why);
    if (!method) throw InputError("--method " + *arguments.method + ": " + why);
    planning.method = *method;
  }
  if (arguments.gain && planning.method != PlanningMethod::kUtility) {
    throw InputError("--gain " + *arguments.gain + ": is of --method utility alone");
  }
  if (arguments.gain) {
    std::string why;
    const std::optional<Formulation> gain = parse_formulation(*arguments.gain, &why);
    if (!gain) throw InputError("--gain " + *arguments.gain + ": " + why);
    planning.gain = *gain;
  }
}

PlannerEnd run_live(const Arguments& arguments, NetworkLink& network, const Clock& clock,
                    const std::atomic<bool>& interrupted, Session& session) {
  PlannerLinkOptions options;
  options.on_lost_robot = arguments.on_lost_robot;
  options.more_counters = [&network] { return network.counters(); };
  PlannerLink link(network.bus(), clock, session, VANTAGE_VERSION, options);
  PlannerEnd end;
  try {
    while (!link.step(&end)) {
      if (const auto refused = network.seals_to_tell()) {
        spdlog::warn("{} messages with a wrong seal so far: somebody has no key, or another one", *refused);
      }
      if (!interrupted) continue;
      end = {session.planning() ? kExitFailure : kExitOk, "interrupted"};
      break;
    }
  } catch (const InputError& error) {  // the disk is full: the robot is told, and what is known is still written
    end = {kExitFailure, error.what()};
  }
  if (end.exit_status == kExitOk) {
    link.say_finished(end.message);
  } else {
    link.say_failed(end.message);
  }
  return end;
}

/// Judges the map by depth maps that were kept out of it.
void check_against(const std::string& log, const OccupancyMap& map) {
  constexpr int kRadiusVoxels = 2;
  MapCheck check;
  LogReader reader(log);
  for (LogEvent event; reader.next(&event);) {
    depth_map_t message;
    DecodeCounters ignored;
    std::string why;
    if (event.channel != channel::kDepthMap || !decode_message(event.bytes, &message, &ignored)) continue;
    if (const auto depth_map = unpack_depth_map(message, &why)) check_depth_map(map, *depth_map, kRadiusVoxels, &check);
  }
  std::printf(
      "%s: %.4f of %lld points within %d voxels of an occupied one, %lld of %lld cameras in an occupied voxel\n",
      log.c_str(), check.share(), static_cast<long long>(check.points), kRadiusVoxels,
      static_cast<long long>(check.cameras_in_occupied), static_cast<long long>(check.cameras));
}

SessionConfig configuration(const Arguments& arguments) {
  SessionConfig config;
  if (!arguments.replay.empty()) {
    const LogContents contents = examine_log(arguments.replay);
    if (contents.config) config = *contents.config;
  }
  if (arguments.config) config = load_session_config(*arguments.config);
  apply(arguments, &config);
  return config;
}

std::unique_ptr<Session> make_session(const Arguments& arguments, const Clock& clock) {
  if (!arguments.resume.empty()) return Session::resume(arguments.resume, clock, std::cout);
  const std::string folder = arguments.session.empty() ? default_session_folder() : arguments.session;
  std::error_code ignored;
  if (!arguments.replay.empty() &&
      std::filesystem::equivalent(folder, std::filesystem::path(arguments.replay).parent_path(), ignored)) {
    throw InputError("--session " + folder + ": is the folder of the log that is replayed; give another");
  }
  auto session = std::make_unique<Session>(configuration(arguments), folder, arguments.overwrite, clock, std::cout);
  std::cout << "session in " << folder << std::endl;
  return session;
}

int run(const Arguments& arguments) {
  const std::atomic<bool>& interrupted = interrupt_flag();
  const bool replaying = !arguments.replay.empty();
  if (!arguments.hold_out.empty()) examine_log(arguments.hold_out);
  std::optional<NetworkLink> network;
  if (!replaying) network.emplace(arguments.network);  // before the session's folder is made
  const SystemClock clock;
  const std::unique_ptr<Session> session = make_session(arguments, clock);
  PlannerEnd end{kExitOk, ""};
  if (replaying) {
    replay_log(arguments.replay, arguments.speed, interrupted, *session);
    end.message = interrupted ? "interrupted" : session->finished() ? session->finish_reason() : "the log has ended";
  } else {
    end = run_live(arguments, *network, clock, interrupted, *session);
  }
  session->write_results();
  if (end.exit_status == kExitOk) {
    spdlog::info("{}", end.message);
  } else {
    spdlog::error("{}", end.message);
  }
  if (!arguments.hold_out.empty()) check_against(arguments.hold_out, session->map());
  std::cout << session->summary() << std::endl;
  return end.exit_status;
}

}  // namespace
}  // namespace vantage

int main(int argc, char** argv) {
  using namespace vantage;
  CLI::App app("The workstation's program of Vantage: depth maps to a map, to the next best view.", "vantage-offboard");
  Arguments arguments;
  auto* anew = app.add_option_group("a new session");
  anew->add_option("--session", arguments.session, "folder of this run (default: sessions/DATE-TIME)");
  anew->add_flag("--overwrite", arguments.overwrite, "replace the session that the folder holds");
  anew->add_option("--config", arguments.config, "configuration file (docs/offboard.md)");
  anew->add_option("--views", arguments.views, "candidate views, lines of x y z qx qy qz qw (default: the paper's 48)");
  anew->add_option("--method", arguments.method,
                   "by what views are chosen: utility (gain and way), view_set (views ahead)");
  anew->add_option("--gain", arguments.gain, "information gain: combined, rear_side_entropy, occlusion_aware, ...");
  anew->add_option("--first-view", arguments.first_view, "id of the first view");
  anew->add_option("--most-views", arguments.most_views, "stop after so many views")->check(CLI::PositiveNumber);
  anew->add_option("--most-way", arguments.most_way_m, "go no farther in all, m")->check(CLI::Range(0.01, 1e5));
  anew->add_option("--gain-threshold", arguments.gain_threshold, "stop when no view gains as much (Eq. 13)");
  anew->add_option("--gain-share", arguments.gain_share,
                   "stop when no view gains that share of what the best did at first")
      ->check(CLI::Range(0.0, 1.0));
  anew->add_option("--truth", arguments.truth, "PLY with points of the true surface, for the coverage");
  anew->add_flag("--no-planning", arguments.no_planning, "integrate what comes; choose no views");
  auto* replay = anew->add_option("--replay", arguments.replay, "replay an LCM log instead of listening to a robot");
  anew->excludes(
      app.add_option("--resume", arguments.resume, "go on with the session in this folder, however it ended"));
  app.add_option("--lcm", arguments.network.url, "LCM address")->capture_default_str();
  app.add_option("--key", arguments.network.keys, "file of vantage-keygen, the robot's too");
  app.add_flag("--insecure", arguments.network.insecure, "without a key, though others can reach the LCM address");
  app.add_option("--on-lost-robot", arguments.on_lost_robot, "when the robot falls silent: end, or wait for it")
      ->transform(CLI::CheckedTransformer(
          std::map<std::string, OnLostRobot>{{"end", OnLostRobot::kEnd}, {"wait", OnLostRobot::kWait}}))
      ->default_str("end");
  anew->add_option("--speed", arguments.speed, "of the replay: 1 as recorded, 0 without waiting")
      ->needs(replay)
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  app.add_option("--hold-out", arguments.hold_out, "LCM log of depth maps to judge the map by");
  app.set_version_flag("--version", VANTAGE_VERSION);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kExitOk : kExitBadInput;
  }
  spdlog::set_pattern("vantage-offboard: %^%v%$");
  return run_program("vantage-offboard", [&] { return run(arguments); });
}
