// vantage-track: where the camera of a recording was. docs/tracking.md.

#include <cstdio>
#include <string>
#include <string_view>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/core.h>

#include "calib/files/input_error.h"
#include "calib/program.h"
#include "calib/rig.h"
#include "drivers/camera/v4l2_camera.h"
#include "onboard/tracking/endurance_run.h"
#include "onboard/tracking/recording_run.h"

namespace vantage::tracking {
namespace {

constexpr std::string_view kDevicePrefix = "v4l2:";

struct Arguments {
  std::string folder, out, states, kinematics, camera_file;
  int frames = 0, rounds = 0;
  std::vector<double> sigma{0.002, 0.2};
  std::vector<double> noise;
  bool one_look = false;
  TrackerOptions tracker;
  RunOptions run;
};

void declare(CLI::App& app, Arguments& a) {
  app.set_version_flag("--version", std::string("vantage-track ") + VANTAGE_VERSION);
  app.add_option("DIR", a.folder,
                 "recording in TUM layout: rgb.txt, camera.yaml, groundtruth.txt if known; or v4l2:DEVICE")
      ->required();
  app.add_option("--out", a.out, "trajectory to write (TUM), frames that have a pose");
  app.add_option("--repeat", a.rounds,
                 "instead: feed the recording so many times, and print what is held after each round")
      ->check(CLI::PositiveNumber);
  app.add_option("--states", a.states, "write state, points and time of every frame");
  app.add_option("--realtime", a.run.realtime_fps, "frames come at this rate; those that come too early are dropped")
      ->check(CLI::Range(0.1, 1000.0));
  app.add_option("--kinematics", a.kinematics, "TUM trajectory: where the robot says the camera was, in metres");
  app.add_option("--kinematics-sigma", a.sigma, "METRES,DEGREES: its standard deviation")->delimiter(',')->expected(2);
  app.add_option("--kinematics-noise", a.noise, "METRES,DEGREES,SEED: noise to add to it, to try how much it bears")
      ->delimiter(',')
      ->expected(3);
  app.add_option("--camera-file", a.camera_file, "with v4l2:DEVICE: a camera.yaml with width, height and intrinsics");
  app.add_option("--frames", a.frames, "with v4l2:DEVICE: end after so many (0: at Ctrl-C)")
      ->check(CLI::NonNegativeNumber);
  app.add_flag("--one-look", a.one_look, "leave frames without a pose that had none when they came");
}

int run_device(Arguments& a) {
  if (a.camera_file.empty()) throw InputError("--camera-file: a device needs one, e.g. camera.yaml");
  const CameraModel camera = load_recording_camera(a.camera_file).camera;
  std::string why;
  if (!camera.valid(&why)) throw InputError(a.camera_file + ": " + why);
  V4l2CameraOptions device;
  device.device = a.folder.substr(kDevicePrefix.size());
  device.stream.width = camera.width;
  device.stream.height = camera.height;
  V4l2Camera source(device);
  a.tracker.mapper.threaded = true;
  const RunSummary summary = run_source(&source, camera, a.tracker, a.frames, interrupt_flag());
  write_tum_trajectory(a.out, summary.trajectory);
  if (!a.states.empty()) write_states(a.states, summary);
  fmt::print("{}\n", to_json(summary));
  return kExitOk;
}

int run(Arguments& a) {
  if (a.out.empty() == (a.rounds == 0)) {
    throw InputError("--out, --repeat: give one of them, e.g. --out trajectory.txt");
  }
  if (a.rounds > 0 && (!a.states.empty() || a.run.realtime_fps > 0 || a.folder.starts_with(kDevicePrefix))) {
    throw InputError("--repeat: needs a recording, without --states and --realtime");
  }
  if (a.folder.starts_with(kDevicePrefix)) return run_device(a);
  Recording recording = open_recording(a.folder);
  constexpr double kRadians = M_PI / 180;
  if (!a.kinematics.empty()) {
    recording.kinematics = read_tum_trajectory(a.kinematics);
    if (!(a.sigma[0] > 0 && a.sigma[1] > 0)) throw InputError("--kinematics-sigma: both must be positive");
    recording.kinematics_sigma_m = a.sigma[0];
    recording.kinematics_sigma_rad = a.sigma[1] * kRadians;
    if (!a.noise.empty()) {
      if (a.noise[2] < 0) throw InputError("--kinematics-noise: the seed must not be negative");
      recording.kinematics =
          with_noise(recording.kinematics, a.noise[0], a.noise[1] * kRadians, static_cast<std::uint64_t>(a.noise[2]));
    }
  } else if (!a.noise.empty()) {
    throw InputError("--kinematics-noise: needs --kinematics");
  }
  if (a.rounds > 0) {
    run_rounds(recording, a.tracker, a.rounds, [](const RoundReport& report) {
      fmt::print("{}\n", to_json(report));
      std::fflush(stdout);
    });
    return kExitOk;
  }
  a.run.second_look = !a.one_look;
  a.tracker.mapper.threaded = a.run.realtime_fps > 0;
  const RunSummary summary = run_recording(recording, a.tracker, a.run);
  write_tum_trajectory(a.out, summary.trajectory);
  if (!a.states.empty()) write_states(a.states, summary);
  fmt::print("{}\n", to_json(summary));
  return kExitOk;
}

}  // namespace
}  // namespace vantage::tracking

int main(int argc, char** argv) {
  CLI::App app("Tracks the camera of a recording and writes its trajectory.");
  vantage::tracking::Arguments arguments;
  vantage::tracking::declare(app, arguments);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? vantage::kExitOk : vantage::kExitBadInput;
  }
  return vantage::run_program("vantage-track", [&] { return vantage::tracking::run(arguments); });
}
