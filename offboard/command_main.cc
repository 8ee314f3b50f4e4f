// vantage-command: stops, pauses, resumes and leads a robot from any computer that has the key.

#include <cstdio>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <vantage/robot_state_t.hpp>

#include "calib/files/input_error.h"
#include "calib/files/trajectory.h"
#include "calib/program.h"
#include "lcmtypes/link/command_sender.h"
#include "lcmtypes/link/network_link.h"
#include "lcmtypes/link/pose_fields.h"
#include "lcmtypes/link/robot_activity.h"
#include "lcmtypes/link/waypoints.h"

namespace vantage {
namespace {

using std::chrono::milliseconds;

constexpr std::chrono::seconds kPatience{3};
constexpr milliseconds kPeriod{50};

/// The robot as it is heard, and how to speak to it.
class Operator {
 public:
  explicit Operator(const NetworkOptions& options)
      : network_(options),
        robot_(network_.bus(), clock_, Role::kPlanner, VANTAGE_VERSION),  // never steps: it listens
        sender_(network_.bus(), clock_, robot_) {
    subscribe_message<robot_state_t>(network_.bus(), channel::kRobotState, &decode_,
                                     [this](const robot_state_t& state) { state_ = state; });
  }

  std::int64_t id() const { return robot_.boot_id(); }

  /// Sends until `shown` says that the robot's state shows it, for three seconds at most.
  template <typename Shown>
  bool tell(CommandKind kind, const std::vector<std::uint8_t>& payload, Shown shown) {
    bool sent = false;
    std::optional<std::chrono::nanoseconds> last;
    return wait([&](std::chrono::nanoseconds now) {
      if (!last || now - *last >= kPeriod) {
        if (sender_.send(kind, payload) && !sent) {
          sent = true;
          state_.reset();  // what was heard before shows nothing
        }
        last = now;
      }
      return sent && state_ && shown(*state_);
    });
  }

  /// Hears the robot until `over`, or until nothing that it says has changed for three seconds.
  template <typename Over>
  bool watch(Over over) {
    std::vector<std::uint8_t> before;
    std::chrono::nanoseconds changed = clock_.monotonic();
    for (;;) {
      network_.bus().handle(milliseconds(20));
      if (state_ && over(*state_)) return true;
      robot_state_t place = state_.value_or(robot_state_t{});
      place.utime = 0;
      if (encode_message(place) != before) {
        before = encode_message(place);
        changed = clock_.monotonic();
      }
      if (clock_.monotonic() - changed > kPatience) return false;
    }
  }

  int fail(const char* what) const {
    std::fprintf(stderr, "vantage-command: %s\n",
                 robot_.peer_boot_id() == 0 ? "no robot was heard within 3 s: same network, same key?" : what);
    return kExitPeerLost;
  }

 private:
  template <typename Done>
  bool wait(Done done) {
    const std::chrono::nanoseconds start = clock_.monotonic();
    while (clock_.monotonic() - start < kPatience) {
      if (done(clock_.monotonic())) return true;
      network_.bus().handle(milliseconds(5));
    }
    return false;
  }

  NetworkLink network_;
  SystemClock clock_;
  Presence robot_;
  CommandSender sender_;
  DecodeCounters decode_;
  std::optional<robot_state_t> state_;
};

int say(const std::string& word, CommandKind kind, const NetworkOptions& options) {
  Operator robot(options);
  const bool obeyed = robot.tell(kind, {}, [kind](const robot_state_t& state) {
    if (kind == CommandKind::kStop) return state.activity == static_cast<std::int8_t>(RobotActivity::kStopped);
    return is_halted(state.activity) == (kind == CommandKind::kPause);
  });
  if (!obeyed) return robot.fail("the robot is heard, but does not show that it obeys");
  std::printf("%s: done\n", word.c_str());
  return kExitOk;
}

int lead(const std::string& file, const NetworkOptions& options) {
  std::vector<Eigen::Isometry3d> poses;
  for (const StampedPose& stamped : read_tum_trajectory(file)) poses.push_back(stamped.T_world_camera);
  if (poses.empty() || poses.size() > kMostWaypoints) {
    throw InputError(file + ": holds " + std::to_string(poses.size()) + " waypoints; 1 to " +
                     std::to_string(kMostWaypoints) + " can be sent");
  }
  Operator robot(options);
  trajectory_t way{};
  way.sender = robot.id();
  way.trajectory_id = 1;
  set_waypoints(poses, &way);
  const auto follows = [&](const robot_state_t& state) { return state.planner == way.sender; };
  if (!robot.tell(CommandKind::kTrajectory, encode_message(way), follows)) {
    return robot.fail("the robot is heard, but does not take the trajectory: is it stopped?");
  }
  std::printf("on its way through %zu waypoints\n", poses.size());
  std::fflush(stdout);
  const bool there = robot.watch([&](const robot_state_t& state) {
    const std::optional<Eigen::Isometry3d> pose = pose_of(state);
    return follows(state) && pose && pose->isApprox(poses.back(), 1e-6);
  });
  if (!there) return robot.fail("the robot stands still before the last waypoint: another goal or a halt came between");
  std::printf("there\n");
  return kExitOk;
}

}  // namespace
}  // namespace vantage

int main(int argc, char** argv) {
  using namespace vantage;
  CLI::App app(
      "Stops, pauses, resumes and leads the robot. A stop goes out at once and is obeyed from any valid key; a paused "
      "robot waits with its planner's goals and can be led.",
      "vantage-command");
  std::string word, file;
  NetworkOptions network;
  const std::map<std::string, CommandKind> kinds = {{"stop", CommandKind::kStop},
                                                    {"pause", CommandKind::kPause},
                                                    {"resume", CommandKind::kResume},
                                                    {"follow", CommandKind::kTrajectory}};
  app.add_option("COMMAND", word, "stop, pause, resume, or follow FILE")->required()->check(CLI::IsMember(kinds));
  app.add_option("FILE", file,
                 "the camera's way, lines of \"time x y z qx qy qz qw\"; the robot's limits set its times");
  app.add_option("--lcm", network.url, "LCM address")->capture_default_str();
  app.add_option("--key", network.keys, "file of vantage-keygen, one of the robot's");
  app.add_flag("--insecure", network.insecure, "without a key, though others can reach the LCM address");
  app.set_version_flag("--version", VANTAGE_VERSION);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kExitOk : kExitBadInput;
  }
  return run_program("vantage-command", [&] {
    const CommandKind kind = kinds.at(word);
    if ((kind == CommandKind::kTrajectory) == file.empty())
      throw InputError("a FILE belongs to follow, and to it alone");
    return kind == CommandKind::kTrajectory ? lead(file, network) : say(word, kind, network);
  });
}
