// vantage-sim-record: what one simulated camera sees on its way, as a recording with the truth. docs/simulator.md.

#include <cstdio>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/core.h>

#include "calib/files/input_error.h"
#include "calib/program.h"
#include "drivers/sim/boxes_room.h"
#include "drivers/sim/mesh.h"
#include "drivers/sim/recording.h"

namespace vantage::sim {
namespace {

struct Arguments {
  std::string out;
  std::string path = "hover";
  std::string object;
  double object_size_m = 0.30;
  std::uint32_t room = 1;
  std::vector<double> covered, jump;
  RecordingOptions recording;
};

void declare(CLI::App& app, Arguments& a) {
  RecordingOptions& r = a.recording;
  app.set_version_flag("--version", std::string("vantage-sim-record ") + VANTAGE_VERSION);
  app.add_option("--out", a.out, "folder for the recording (TUM layout)")->required();
  app.add_option("--path", a.path, "hover, slide, forward, circle, rotate, turn or dash")->capture_default_str();
  app.add_option("--room", a.room, "number of the room of boxes")->capture_default_str();
  app.add_option("--object", a.object, "a mesh in the room, instead of boxes");
  app.add_option("--object-size", a.object_size_m, "its largest side, metres")->capture_default_str();
  app.add_option("--frames", r.frames, "how many")->capture_default_str();
  app.add_option("--fps", r.frames_per_s, "frames per second")->capture_default_str();
  app.add_option("--seed", r.seed, "of the noise")->capture_default_str();
  app.add_option("--camera-noise", r.noise_sigma, "standard deviation, grey levels")->capture_default_str();
  app.add_option("--depth-every", r.truth_depth_every, "write the true depth of every so many frames (0: none)")
      ->capture_default_str();
  app.add_option("--exposure", r.exposure_s, "seconds the shutter is open: blurs")->capture_default_str();
  app.add_option("--light-swing", r.light_swing, "share by which the light goes up and down")->capture_default_str();
  app.add_option("--covered", a.covered, "FROM,TO seconds with the lens covered")->delimiter(',')->expected(2);
  app.add_option("--jump", a.jump, "AT,DEGREES: the camera is suddenly turned to the side")
      ->delimiter(',')
      ->expected(2);
}

int run(Arguments& a) {
  a.recording.path = camera_path_named(a.path);
  if (!a.covered.empty()) {
    a.recording.covered_from_s = a.covered[0];
    a.recording.covered_to_s = a.covered[1];
  }
  if (!a.jump.empty()) {
    a.recording.jump_at_s = a.jump[0];
    a.recording.jump_deg = a.jump[1];
  }
  World world = boxes_room(a.room);
  if (!a.object.empty()) world.object = load_mesh(a.object, {.size_m = a.object_size_m, .up = std::nullopt});
  const std::atomic<bool>& interrupted = interrupt_flag();
  int done = 0;
  write_recording(world, a.recording, a.out, [&](int frames) {
    done = frames;
    return !interrupted;
  });
  fmt::print("vantage-sim-record: {} frames in {}\n", done, a.out);
  return kExitOk;
}

}  // namespace
}  // namespace vantage::sim

int main(int argc, char** argv) {
  CLI::App app("Records what a simulated camera sees on its way through a room, with poses and depth.");
  vantage::sim::Arguments arguments;
  vantage::sim::declare(app, arguments);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? vantage::kExitOk : vantage::kExitBadInput;
  }
  return vantage::run_program("vantage-sim-record", [&] { return vantage::sim::run(arguments); });
}
