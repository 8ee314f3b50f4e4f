// vantage-onboard: the robot's program. Camera to depth maps, goals to motion.

#include <numbers>

#include <CLI/CLI.hpp>
#include <spdlog/spdlog.h>

#include "calib/files/input_error.h"
#include "calib/program.h"
#include "calib/rig.h"
#include "calib/shipped_rig.h"
#include "drivers/camera/image_folder.h"
#include "drivers/camera/v4l2_camera.h"
#include "drivers/robot/camera_carrier.h"
#include "drivers/sim/sim_camera.h"
#include "lcmtypes/link/network_link.h"
#include "onboard/executive/executive.h"
#include "onboard/executive/stereo_view.h"
#include "onboard/hand_held_camera.h"
#include "onboard/hardware_check.h"
#include "onboard/monocular_depth.h"
#include "onboard/robot_link.h"

namespace vantage {
namespace {

constexpr std::chrono::seconds kSimulatorPatience{5};

struct Arguments {
  std::string camera;
  std::string rig;
  double distance_m = HandHeldOptions{}.distance_m, down_deg = 30, height_m = HandHeldOptions{}.height_m;
  NetworkOptions network;
  double rate_mbit_s = 100;
  std::string spool;
  OnLostPlanner on_lost_planner = OnLostPlanner::kEnd;
  std::string can = "none";
  bool check = false, list_cameras = false;
};

enum class CameraKind { kSimulator, kV4l2, kImages };

/// What --camera names.
struct CameraChoice {
  CameraKind kind;
  std::string name;  ///< socket, device or folder
};

CameraChoice camera_choice(const std::string& camera) {
  using Prefix = std::pair<std::string_view, CameraKind>;
  for (const auto& [prefix, kind] : {Prefix{"sim:", CameraKind::kSimulator}, Prefix{"v4l2:", CameraKind::kV4l2},
                                     Prefix{"images:", CameraKind::kImages}}) {
    if (camera.starts_with(prefix) && camera.size() > prefix.size()) return {kind, camera.substr(prefix.size())};
  }
  throw InputError("--camera " + camera + ": expected v4l2:DEVICE, images:FOLDER, or sim:SOCKET (of vantage-sim)");
}

class FreeFlyingCarrier final : public CameraCarrier {
 public:
  explicit FreeFlyingCarrier(sim::SimCamera& camera) : camera_(camera) {}
  bool set_pose(const Eigen::Isometry3d& T_world_camera) override { return camera_.set_pose(T_world_camera); }
  bool alive() override { return camera_.connected(); }

 private:
  sim::SimCamera& camera_;
};

void require_same_camera(const Rig& rig, const std::string& rig_path, const sim::SimCamera& camera) {
  const CameraModel& simulated = camera.camera();
  const bool monocular = rig.stereo_baseline_m == 0;
  if (rig.camera == simulated && (monocular || rig.stereo_baseline_m == camera.baseline_m())) return;
  throw InputError(rig_path + ": its camera (" + std::to_string(rig.camera.width) + " x " +
                   std::to_string(rig.camera.height) + ", f " + std::to_string(rig.camera.fx) + " px, baseline " +
                   std::to_string(rig.stereo_baseline_m) + " m) is not the simulator's (" +
                   std::to_string(simulated.width) + " x " + std::to_string(simulated.height) + ", f " +
                   std::to_string(simulated.fx) + " px, baseline " + std::to_string(camera.baseline_m()) +
                   " m): give the rig file of the camera that is there");
}

/// What the rig has eyes for: depth from a stereo pair, or from a single camera that moves.
class Eyes {
 public:
  explicit Eyes(const Rig& rig) {
    if (rig.stereo_baseline_m > 0) {
      matcher_.emplace(rig.camera, rig.stereo_baseline_m);
      stereo_.emplace(*matcher_);
    } else {
      monocular_.emplace(rig);
    }
  }

  ViewDepth& depth() { return stereo_ ? static_cast<ViewDepth&>(*stereo_) : *monocular_; }

  /// For the program's status.
  void add_counters(Status::Counters* counters) const {
    if (!monocular_) return;
    const MonocularCounts& counts = monocular_->counts();
    counters->insert(counters->end(), {{"camera.frames", counts.frames},
                                       {"tracking.without_pose", counts.without_pose},
                                       {"tracking.losses", counts.losses},
                                       {"depth.views", counts.views},
                                       {"depth.views_by_kinematics", counts.views_by_kinematics}});
  }

 private:
  std::optional<StereoDepth> matcher_;
  std::optional<StereoView> stereo_;
  std::optional<MonocularDepth> monocular_;
};

int check(const Arguments& arguments) {
  const std::string can = arguments.can == "none" ? "" : arguments.can;
  if (arguments.camera.empty() && can.empty()) throw InputError("--check needs --camera, --can or both");
  const std::string rig = arguments.rig.empty() ? shipped_rig("youbot.yaml").string() : arguments.rig;
  return check_hardware(load_rig(rig), rig, arguments.camera, can);
}

/// Serves the link until there is a reason to end, and says it.
int serve(const Arguments& arguments, RobotBody& body, const std::function<void(Status::Counters*)>& add_counters) {
  const std::atomic<bool>& interrupted = interrupt_flag();
  const SystemClock clock;
  NetworkLink network(arguments.network);
  RobotLinkOptions options;
  options.on_lost_planner = arguments.on_lost_planner;
  options.sender.rate_bit_s = arguments.rate_mbit_s * 1e6;
  options.sender.spool.folder = arguments.spool;
  options.more_counters = [&] {
    Status::Counters counters = network.counters();
    add_counters(&counters);
    return counters;
  };
  RobotLink link(network.bus(), clock, body, VANTAGE_VERSION, options);
  RobotEnd end;
  while (!link.step(&end)) {
    if (const auto refused = network.seals_to_tell()) {
      spdlog::warn("{} messages with a wrong seal so far: somebody has no key, or another one", *refused);
    }
    if (!interrupted) continue;
    end = {kExitOk, "interrupted"};
    break;
  }
  if (end.exit_status == kExitOk && !interrupted) {
    link.say_finished(end.message);
  } else {
    link.say_failed(end.message);
  }
  if (end.exit_status == kExitOk) {
    spdlog::info("{}", end.message);
  } else {
    spdlog::error("{}", end.message);
  }
  return end.exit_status;
}

int run_simulated(const Arguments& arguments, const CameraChoice& choice, const Rig& rig) {
  if (rig.camera.distortion != Distortion::kNone) {
    throw InputError(arguments.rig + ": camera: the simulator's has no distortion: model pinhole");
  }
  Eyes eyes(rig);
  using sim::SimCamera;
  SimCamera camera(choice.name, kSimulatorPatience,
                   rig.stereo_baseline_m > 0 ? SimCamera::Eyes::kBoth : SimCamera::Eyes::kLeft);
  require_same_camera(rig, arguments.rig, camera);
  FreeFlyingCarrier carrier(camera);
  int status = kExitOk;
  {
    Executive executive(camera, carrier, eyes.depth(), {rig.linear_speed_limit_m_s, rig.angular_speed_limit_rad_s});
    spdlog::info("camera {}: {} x {}, {}; waiting for goals", arguments.camera, rig.camera.width, rig.camera.height,
                 rig.stereo_baseline_m > 0 ? "stereo" : "monocular");
    status = serve(arguments, executive, [&eyes](Status::Counters* counters) { eyes.add_counters(counters); });
  }
  camera.goodbye();
  return status;
}

int run_by_hand(const Arguments& arguments, const CameraChoice& choice, const Rig& rig) {
  if (rig.stereo_baseline_m > 0) {
    throw InputError(arguments.rig + ": stereo_baseline: a pair can't be carried by hand; leave it out");
  }
  HandHeldOptions options;
  options.distance_m = arguments.distance_m;
  options.down_rad = arguments.down_deg * std::numbers::pi / 180;
  options.height_m = arguments.height_m;
  options.every_frame = choice.kind == CameraKind::kImages;
  std::unique_ptr<FrameSource> source;
  if (choice.kind == CameraKind::kImages) {
    source = std::make_unique<ImageFolder>(
        ImageFolderOptions{.folder = choice.name, .rate_hz = rig.capture.rate_hz, .in_real_time = false});
  } else {
    source = std::make_unique<V4l2Camera>(v4l2_options(rig, choice.name));
  }
  HandHeldCamera camera(*source, rig, options);
  spdlog::info("camera {}: {} x {}, carried by hand", arguments.camera, rig.camera.width, rig.camera.height);
  return serve(arguments, camera, [&camera](Status::Counters* counters) {
    const HandHeldCamera::Counts counts = camera.counts();
    const auto add = [counters](const char* name, std::uint64_t value) { counters->emplace_back(name, value); };
    add("camera.frames", counts.frames);
    add("tracking.without_pose", counts.without_pose);
    add("tracking.losses", counts.losses);
    add("depth.maps", counts.depth_maps);
    add("depth.frames_passed_over", counts.passed_over);
    add("depth.maps_given_up", counts.given_up);
  });
}

int run(const Arguments& arguments) {
  if (arguments.list_cameras) return list_cameras();
  if (arguments.check) return check(arguments);
  if (arguments.rig.empty()) throw InputError("--rig FILE is needed, e.g. calib/rigs/simulated_stereo.yaml");
  if (arguments.can != "none")
    throw InputError("--can " + arguments.can + ": drives are only used with --check so far");
  const CameraChoice choice = camera_choice(arguments.camera);
  const Rig rig = load_rig(arguments.rig);
  return choice.kind == CameraKind::kSimulator ? run_simulated(arguments, choice, rig)
                                               : run_by_hand(arguments, choice, rig);
}

}  // namespace
}  // namespace vantage

int main(int argc, char** argv) {
  using namespace vantage;
  CLI::App app("The robot's program of Vantage: camera to depth maps, goals to motion.", "vantage-onboard");
  Arguments arguments;
  app.add_option("--camera", arguments.camera,
                 "v4l2:DEVICE or images:FOLDER, carried by hand; sim:SOCKET: the simulator's, on its carrier");
  app.add_option("--rig", arguments.rig,
                 "rig file: camera, baseline, limits, drives (calib/rigs/*.yaml; with --check youbot.yaml)");
  app.add_option("--distance", arguments.distance_m,
                 "by hand: metres from the first view to what it looks at; nothing else tells how large things are")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  app.add_option("--down", arguments.down_deg, "by hand: degrees by which the first view looks down")
      ->check(CLI::Range(-89.0, 89.0))
      ->capture_default_str();
  app.add_option("--height", arguments.height_m, "by hand: metres above the ground of what the first view looks at")
      ->check(CLI::Range(-10.0, 10.0))
      ->capture_default_str();
  app.add_option("--can", arguments.can, "the drives' bus: an interface, sim:SOCKET, or none")->capture_default_str();
  app.add_flag("--check", arguments.check, "look at camera and drives, move nothing, and end");
  app.add_flag("--list-cameras", arguments.list_cameras, "tell cameras, formats and frame rates, and end");
  app.add_option("--lcm", arguments.network.url, "LCM address")->capture_default_str();
  app.add_option("--key", arguments.network.keys,
                 "file of vantage-keygen, the planner's too; several: any may command");
  app.add_flag("--insecure", arguments.network.insecure, "without a key, though others can reach the LCM address");
  app.add_option("--rate", arguments.rate_mbit_s, "of depth maps on the network, Mbit/s")
      ->check(CLI::Range(0.1, 10'000.0))
      ->capture_default_str();
  app.add_option("--spool", arguments.spool,
                 "folder that keeps depth maps until they are acknowledged, over restarts too (default: memory alone)");
  app.add_option("--on-lost-planner", arguments.on_lost_planner, "when the planner falls silent: end, or hold still")
      ->transform(CLI::CheckedTransformer(
          std::map<std::string, OnLostPlanner>{{"end", OnLostPlanner::kEnd}, {"hold", OnLostPlanner::kHold}}))
      ->default_str("end");
  app.set_version_flag("--version", VANTAGE_VERSION);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kExitOk : kExitBadInput;
  }
  spdlog::set_pattern("vantage-onboard: %^%v%$");
  return run_program("vantage-onboard", [&] { return run(arguments); });
}
