// vantage-sim: a room, an object and a stereo camera that another program moves; drives on a CAN bus.
// docs/simulator.md.

#include <array>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <exception>
#include <memory>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/core.h>
#include <poll.h>
#include <sys/signalfd.h>

#include "calib/files/input_error.h"
#include "calib/files/ply.h"
#include "calib/look_at.h"
#include "calib/program.h"
#include "calib/rig.h"
#include "calib/shipped_rig.h"
#include "drivers/sim/drive_service.h"
#include "drivers/sim/mesh.h"
#include "drivers/sim/server.h"
#include "drivers/sim/snapshot.h"
#include "drivers/sim/stereo_camera.h"
#include "drivers/sim/surface_samples.h"
#include "drivers/sim/unix_socket.h"

namespace vantage::sim {
namespace {

/// Enough that 1 cm² of a 30 cm object holds a dozen points: coverage is then known to a few parts in a thousand.
constexpr std::size_t kTruthPoints = 50'000;

struct Arguments {
  std::string object;
  double object_size_m = 0.30;
  std::string up;
  std::uint64_t seed = 1;
  double noise_sigma = 2;
  double exposure_s = 0.010;
  std::vector<double> carrier_noise = {0, 0};
  int threads = 0;
  std::string socket;
  double wait_s = 0;
  bool keep_serving = false;
  std::string truth;
  std::string snapshot;
  std::vector<double> eye = {0.6, 0, 0.35};
  std::string can;
  std::string rig;
};

void declare(CLI::App& app, Arguments& a) {
  app.set_version_flag("--version", std::string("vantage-sim ") + VANTAGE_VERSION);
  app.add_option("--object", a.object, "mesh to look at: PLY, OBJ, GLB (scripts/fetch-models has some)");
  app.add_option("--object-size", a.object_size_m, "its largest side, metres")->capture_default_str();
  app.add_option("--up", a.up, "which axis of the file points up (default: y for OBJ and GLB, else z)")
      ->check(CLI::IsMember({"y", "z"}));
  app.add_option("--seed", a.seed, "of texture and noise")->capture_default_str();
  app.add_option("--camera-noise", a.noise_sigma, "standard deviation, grey levels")->capture_default_str();
  app.add_option("--exposure", a.exposure_s, "seconds; 0.010 makes white 255")->capture_default_str();
  app.add_option("--carrier-noise", a.carrier_noise,
                 "METRES,DEGREES: standard deviation of where the camera stands from where its carrier says")
      ->delimiter(',')
      ->expected(2)
      ->check(CLI::Range(0.0, 10.0));
  app.add_option("--threads", a.threads, "that render (0: one a core)")->check(CLI::Range(0, 256));
  app.add_option("--socket", a.socket, "serve frames at this path");
  app.add_option("--wait", a.wait_s, "give up when no client comes within this many seconds")
      ->check(CLI::Range(1.0, 1e6));
  app.add_flag("--keep-serving", a.keep_serving, "go on when a client vanishes: another may come");
  app.add_option("--write-truth", a.truth, "write points of the object's outer surface, PLY");
  app.add_option("--snapshot", a.snapshot, "write what the left camera sees, PNG");
  app.add_option("--pose", a.eye, "where the snapshot's camera stands, x,y,z in metres; it looks at the object")
      ->delimiter(',')
      ->expected(3);
  app.add_option("--can", a.can, "serve a robot's drives on this CAN interface, or on sim:SOCKET");
  app.add_option("--rig", a.rig, "rig file that describes the drives (default: calib/rigs/youbot.yaml)");
}

StereoOptions stereo_options(const Arguments& arguments) {
  StereoOptions options;
  options.noise_sigma = arguments.noise_sigma;
  options.exposure_s = arguments.exposure_s;
  options.seed = arguments.seed;
  std::string why;
  if (!options.valid(&why)) throw InputError("--camera-noise or --exposure: " + why);
  return options;
}

void write_snapshot(const Arguments& arguments, const StereoCamera& camera, const Eigen::Vector3d& target) {
  const Eigen::Vector3d eye(arguments.eye[0], arguments.eye[1], arguments.eye[2]);
  if (!eye.allFinite() || (eye - target).norm() < 1e-3) {
    throw InputError("--pose: must be finite and away from the object's centre");
  }
  std::vector<std::uint8_t> left(camera.pixels()), right(camera.pixels());
  camera.capture(look_at(eye, target), 0, left, right);
  write_image(arguments.snapshot, camera.options().camera.width, camera.options().camera.height, left);
}

/// A descriptor that becomes readable on SIGINT and SIGTERM, which do nothing else in this thread and those it starts
/// later: to be called before there are others.
FileDescriptor catch_signals() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGTERM);
  sigprocmask(SIG_BLOCK, &signals, nullptr);
  return FileDescriptor(::signalfd(-1, &signals, SFD_CLOEXEC));
}

int serve(const Arguments& arguments, const StereoCamera& camera, const Eigen::Vector3d& target,
          const FileDescriptor& signals) {
  ServerOptions options;
  options.socket = arguments.socket;
  if (arguments.wait_s > 0) options.wait = std::chrono::seconds(static_cast<std::int64_t>(arguments.wait_s));
  options.keep_serving = arguments.keep_serving;
  options.first_pose = look_at({0.6, 0, 0.35}, target);
  options.carrier_sigma_m = arguments.carrier_noise[0];
  options.carrier_sigma_rad = arguments.carrier_noise[1] * std::numbers::pi / 180;
  Server server(camera, options);
  fmt::print("vantage-sim: serving {} ({:.2f} m) on {}\n", std::filesystem::path(arguments.object).filename().string(),
             arguments.object_size_m, arguments.socket);
  std::fflush(stdout);
  switch (server.run(signals.get())) {
    case ServeEnd::kGoodbye:
    case ServeEnd::kStopped:
      return kExitOk;
    case ServeEnd::kClientLost:
      fmt::print(stderr, "vantage-sim: the client has gone without a goodbye\n");
      return kExitPeerLost;
    case ServeEnd::kNobodyCame:
      fmt::print(stderr, "vantage-sim: no client came within {} s\n", arguments.wait_s);
      return kExitPeerLost;
  }
  return kExitFailure;
}

/// Drives on a CAN bus, in a thread of their own. Nothing when none are asked for.
std::unique_ptr<DriveService> serve_drives(const Arguments& arguments) {
  if (arguments.can.empty()) return nullptr;
  const std::string path = arguments.rig.empty() ? shipped_rig("youbot.yaml").string() : arguments.rig;
  const Rig rig = load_rig(path);
  if (!rig.drives) throw InputError(path + ": describes no drives; try calib/rigs/youbot.yaml");
  auto service = std::make_unique<DriveService>(arguments.can, *rig.drives, arguments.seed);
  fmt::print("vantage-sim: {} drives on {}\n", rig.drives->axes(), arguments.can);
  std::fflush(stdout);
  return service;
}

void wait_for(const FileDescriptor& signals) {
  pollfd polled{signals.get(), POLLIN, 0};
  while (::poll(&polled, 1, -1) < 0 && errno == EINTR) {
  }
}

int run(const Arguments& arguments) {
  const bool shows = !arguments.socket.empty() || !arguments.truth.empty() || !arguments.snapshot.empty();
  if (!shows && arguments.can.empty()) {
    throw InputError("nothing to do; give --socket PATH, --can IFACE, --write-truth FILE or --snapshot FILE");
  }
  if (shows && arguments.object.empty()) throw InputError("--object FILE is needed to have something to look at");
  const StereoOptions stereo = stereo_options(arguments);
  FileDescriptor signals;
  if (!arguments.socket.empty() || !arguments.can.empty()) signals = catch_signals();
  const std::unique_ptr<DriveService> drives = serve_drives(arguments);
  if (!shows) {
    wait_for(signals);
    return kExitOk;
  }
  MeshOptions mesh_options;
  mesh_options.size_m = arguments.object_size_m;
  if (!arguments.up.empty()) mesh_options.up = arguments.up == "y" ? UpAxis::kY : UpAxis::kZ;
  World world;
  world.object = load_mesh(arguments.object, mesh_options);
  world.texture_seed = static_cast<std::uint32_t>(arguments.seed);
  const Eigen::Vector3d centre = 0.5 * (world.object.lowest() + world.object.highest()).cast<double>();

  if (!arguments.truth.empty()) {
    PlyModel truth;
    truth.points = sample_surface(world.object, kTruthPoints, arguments.seed);
    write_ply(arguments.truth, truth);
  }
  if (arguments.socket.empty() && arguments.snapshot.empty()) return kExitOk;
  const StereoCamera camera(std::make_shared<Renderer>(world, arguments.threads), stereo);
  if (!arguments.snapshot.empty()) write_snapshot(arguments, camera, centre);
  return arguments.socket.empty() ? static_cast<int>(kExitOk) : serve(arguments, camera, centre, signals);
}

}  // namespace
}  // namespace vantage::sim

int main(int argc, char** argv) {
  CLI::App app("Simulates a room, an object and a stereo camera, and the drives of a robot.");
  vantage::sim::Arguments arguments;
  vantage::sim::declare(app, arguments);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? vantage::kExitOk : vantage::kExitBadInput;
  }
  return vantage::run_program("vantage-sim", [&] { return vantage::sim::run(arguments); });
}
