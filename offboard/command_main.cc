// vantage-command: stops, pauses and resumes a robot from any computer that has the key.

#include <cstdio>
#include <optional>
#include <string>

#include <CLI/CLI.hpp>
#include <vantage/robot_state_t.hpp>

#include "calib/files/input_error.h"
#include "calib/program.h"
#include "lcmtypes/link/command_sender.h"
#include "lcmtypes/link/network_link.h"

namespace vantage {
namespace {

using std::chrono::milliseconds;

constexpr std::chrono::seconds kPatience{3};
constexpr milliseconds kPeriod{50};
constexpr std::int8_t kPausedCode = 3, kStoppedCode = 4;  // robot_state_t::activity

bool obeyed(CommandKind kind, std::int8_t activity) {
  switch (kind) {
    case CommandKind::kStop:
      return activity == kStoppedCode;
    case CommandKind::kPause:
      return activity >= kPausedCode;
    default:
      return activity < kPausedCode;
  }
}

/// Sends until the robot's state shows it, for three seconds at most.
int run(CommandKind kind, const std::string& word, const NetworkOptions& options) {
  NetworkLink network(options);
  MessageBus& bus = network.bus();
  const SystemClock clock;
  Presence robot(bus, clock, Role::kPlanner, VANTAGE_VERSION);  // never steps: it listens
  CommandSender sender(bus, clock, robot);
  DecodeCounters decode;
  bool sent = false, shown = false;
  subscribe_message<robot_state_t>(bus, channel::kRobotState, &decode,
                                   [&](const robot_state_t& state) { shown = sent && obeyed(kind, state.activity); });
  const std::chrono::nanoseconds start = clock.monotonic();
  std::optional<std::chrono::nanoseconds> last;
  while (!shown && clock.monotonic() - start < kPatience) {
    if (!last || clock.monotonic() - *last >= kPeriod) {
      sent |= sender.send(kind);
      last = clock.monotonic();
    }
    bus.handle(milliseconds(5));
  }
  if (shown) {
    std::printf("%s: done\n", word.c_str());
    return kExitOk;
  }
  std::fprintf(stderr, "vantage-command: %s\n",
               robot.peer_boot_id() == 0 ? "no robot was heard within 3 s: same network, same key?"
                                         : "the robot is heard, but does not show that it obeys");
  return kExitPeerLost;
}

}  // namespace
}  // namespace vantage

int main(int argc, char** argv) {
  using namespace vantage;
  CLI::App app("Stops, pauses and resumes the robot. A stop goes out at once and is obeyed from any valid key.",
               "vantage-command");
  std::string word;
  NetworkOptions network;
  const std::map<std::string, CommandKind> kinds = {
      {"stop", CommandKind::kStop}, {"pause", CommandKind::kPause}, {"resume", CommandKind::kResume}};
  app.add_option("COMMAND", word, "stop, pause or resume")->required()->check(CLI::IsMember(kinds));
  app.add_option("--lcm", network.url, "LCM address")->capture_default_str();
  app.add_option("--key", network.keys, "file of vantage-keygen, one of the robot's");
  app.add_flag("--insecure", network.insecure, "without a key, though others can reach the LCM address");
  app.set_version_flag("--version", VANTAGE_VERSION);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kExitOk : kExitBadInput;
  }
  return run_program("vantage-command", [&] { return run(kinds.at(word), word, network); });
}
