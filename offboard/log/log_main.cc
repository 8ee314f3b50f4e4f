// vantage-log: looks into an LCM log, checks it, cuts it, and writes what it holds in other programs' formats.

#include <iostream>
#include <map>
#include <optional>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "calib/files/input_error.h"
#include "calib/program.h"
#include "offboard/log/cloud_export.h"
#include "offboard/log/image_export.h"
#include "offboard/log/log_check.h"
#include "offboard/log/log_cut.h"
#include "offboard/log/log_info.h"
#include "offboard/log/log_scan.h"
#include "offboard/log/mcap_export.h"
#include "offboard/log/trajectory_export.h"

namespace vantage {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  std::string log;
  bool overwrite = false;
  std::string out, from, to, channels;  // cut
  std::string tum, png, ply, mcap;      // export
  PoseSource tum_from = PoseSource::kDepthMaps;
  CloudExportOptions cloud;
};

void refuse_existing(const std::string& path, bool overwrite) {
  std::error_code ignored;
  if (!path.empty() && !overwrite && fs::exists(path, ignored)) {
    throw InputError(path + ": exists; give another name, or --overwrite");
  }
}

int info(const Arguments& arguments) {
  const fs::path log = log_of(arguments.log);
  print_log_info(log, read_log_info(log), std::cout);
  return kExitOk;
}

int check(const Arguments& arguments) {
  const fs::path log = log_of(arguments.log);
  const LogCheck found = check_log(log, std::cout);
  std::cout << fmt::format("{}: {} events, {} depth maps and {} in chunks, {} events of unknown channels", log.string(),
                           found.events, found.whole_maps, found.maps_in_chunks, found.unknown);
  if (found.foreign_chunks > 0)
    std::cout << fmt::format(", {} chunks of maps that no event announces", found.foreign_chunks);
  std::cout << (found.faults == 0 ? std::string("; no fault\n")
                                  : fmt::format("; {} fault{}\n", found.faults, found.faults == 1 ? "" : "s"));
  return found.faults == 0 ? kExitOk : kExitFailure;
}

std::optional<LogTime> time_of(const char* option, const std::string& text) {
  if (text.empty()) return std::nullopt;
  const std::optional<LogTime> time = parse_log_time(text);
  if (!time) {
    throw InputError(
        fmt::format("{} {}: expected seconds or HH:MM:SS from the log's start, or seconds since 1970", option, text));
  }
  return time;
}

int cut(const Arguments& arguments) {
  const fs::path log = log_of(arguments.log);
  const CutOptions options{time_of("--from", arguments.from), time_of("--to", arguments.to), arguments.channels};
  refuse_existing(arguments.out, arguments.overwrite);
  std::error_code ignored;
  if (fs::equivalent(log, arguments.out, ignored))
    throw InputError(arguments.out + ": is the log that is cut; give another name");
  const CutResult result = cut_log(log, arguments.out, options);
  std::cout << fmt::format("{}: {} of {} events", arguments.out, result.kept, result.events);
  if (result.damaged_places > 0) std::cout << fmt::format("; {} damaged places left out", result.damaged_places);
  if (result.torn_bytes > 0) std::cout << fmt::format("; a torn end of {} bytes cut off", result.torn_bytes);
  std::cout << '\n';
  return kExitOk;
}

int export_all(const Arguments& arguments) {
  if (arguments.tum.empty() && arguments.png.empty() && arguments.ply.empty() && arguments.mcap.empty()) {
    throw InputError("export: say what: --tum FILE, --png FOLDER, --ply FILE, --mcap FILE");
  }
  const fs::path log = log_of(arguments.log);
  for (const std::string* file : {&arguments.tum, &arguments.ply, &arguments.mcap})
    refuse_existing(*file, arguments.overwrite);
  if (!arguments.tum.empty()) {
    const TrajectoryExport result = export_trajectory(log, arguments.tum_from, arguments.tum);
    std::cout << fmt::format("{}: {} poses, {} left out\n", arguments.tum, result.poses, result.left_out);
  }
  if (!arguments.png.empty()) {
    const ImageExport result = export_images(log, arguments.png, arguments.overwrite);
    std::cout << fmt::format("{}: {} depth maps, {} pixels too far for 16 bit\n", arguments.png, result.depth_maps,
                             result.too_far);
  }
  if (!arguments.ply.empty()) {
    const CloudExport result = export_cloud(log, arguments.cloud, arguments.ply);
    std::cout << fmt::format("{}: {} points of {} depth maps\n", arguments.ply, result.points, result.depth_maps);
  }
  if (!arguments.mcap.empty()) {
    const McapExport result = export_mcap(log, arguments.mcap);
    std::cout << fmt::format("{}: {} events as {} messages in {} chunks\n", arguments.mcap, result.events,
                             result.messages, result.chunks);
    if (result.faulty > 0)
      std::cout << fmt::format("{} events do not hold; `vantage-log check` names them\n", result.faulty);
  }
  return kExitOk;
}

}  // namespace
}  // namespace vantage

int main(int argc, char** argv) {
  using namespace vantage;
  CLI::App app("Looks into an LCM log, checks it, cuts it, exports it. LOG: a log's first part, or a session's folder.",
               "vantage-log");
  Arguments arguments;
  int (*verb)(const Arguments&) = nullptr;
  const auto add_verb = [&](const char* name, const char* about, int (*run)(const Arguments&)) {
    CLI::App* added = app.add_subcommand(name, about);
    added->add_option("log", arguments.log, "log or session folder")->required();
    added->callback([&verb, run] { verb = run; });
    return added;
  };
  add_verb("info", "what a log holds", &info);
  add_verb("check", "whether it holds: status 0, or 1 and a line a fault", &check);
  CLI::App* cutting = add_verb("cut", "copy a part of it; damage stays out", &cut);
  cutting->add_option("out", arguments.out, "the log to write")->required();
  cutting->add_option("--from", arguments.from, "seconds or HH:MM:SS from the log's start, or seconds since 1970");
  cutting->add_option("--to", arguments.to, "likewise; events before it are kept");
  cutting->add_option("--channels", arguments.channels, "a regular expression that fits the whole name");
  CLI::App* exporting = add_verb("export", "write what it holds in other formats", &export_all);
  exporting->add_option("--tum", arguments.tum, "camera poses as a TUM trajectory");
  exporting->add_option("--tum-from", arguments.tum_from, "maps: of the depth maps; states: of the robot's states")
      ->transform(CLI::CheckedTransformer(
          std::map<std::string, PoseSource>{{"maps", PoseSource::kDepthMaps}, {"states", PoseSource::kRobotStates}}))
      ->default_str("maps");
  exporting->add_option("--png", arguments.png, "folder for depth maps as 16-bit PNG, in TUM's layout");
  auto* ply = exporting->add_option("--ply", arguments.ply, "converged points with normals");
  exporting
      ->add_flag("--session-region", arguments.cloud.session_region, "the points that the session keeps in cloud.ply")
      ->needs(ply);
  exporting->add_option("--spacing", arguments.cloud.spacing_m, "one point a cell of this edge, m (default: 0.002)")
      ->needs(ply)
      ->check(CLI::Range(1e-5, 10.0));
  exporting->add_option("--mcap", arguments.mcap, "everything, for Foxglove and the like");
  for (CLI::App* writes : {cutting, exporting}) {
    writes->add_flag("--overwrite", arguments.overwrite, "replace what is there");
  }
  app.require_subcommand(1);
  app.set_version_flag("--version", VANTAGE_VERSION);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kExitOk : kExitBadInput;
  }
  return run_program("vantage-log", [&] { return verb(arguments); });
}
