// Drives a robot as its own program would, and tells what came of it: a test program of scripts/test-hardware.
//   drive_robot BUS RIG SECONDS [recover]
// Sets up, homes, switches on; then every joint swings as a sine and the base drives circles for SECONDS. Prints
// "name value" lines. Exit status 0: no fault, or every one was recovered from; 4: a fault, told on stdout.

#include <chrono>
#include <cmath>
#include <cstdio>
#include <string>
#include <thread>

#include "calib/files/input_error.h"
#include "calib/program.h"
#include "calib/rig.h"
#include "drivers/can/open_can_bus.h"
#include "drivers/robot/drive_thread.h"

namespace vantage {
namespace {

using std::chrono::milliseconds;
using std::chrono::nanoseconds;
using std::chrono::seconds;

constexpr int kExitFault = 4;
constexpr double kSwing = 0.5, kSwingPeriod_s = 4;  // rad, s

double seconds_of(nanoseconds time) { return std::chrono::duration<double>(time).count(); }

class Session {
 public:
  Session(const std::string& bus, const Rig& rig, bool recovers)
      : bus_(can::open_can_bus(bus)), rig_(*rig.drives), robot_(*bus_, clock_, rig_), recovers_(recovers) {}

  int run(seconds duration) {
    const RealtimeState& realtime = robot_.realtime();
    std::printf("realtime %s\n", realtime.missing.empty() ? "SCHED_FIFO, memory locked" : realtime.missing.c_str());
    for (const auto& [name, request] : {std::pair{"set_up", DriveRequest::kSetUp},
                                        {"home", DriveRequest::kHome},
                                        {"enable", DriveRequest::kEnable}}) {
      const nanoseconds begin = clock_.monotonic();
      if (const std::string fault = robot_.request(request); !fault.empty()) return tell(fault);
      say(name, seconds_of(clock_.monotonic() - begin));
    }
    robot_.clear_figures();
    start_ = clock_.monotonic();
    std::printf("moving\n");
    std::fflush(stdout);
    while (clock_.monotonic() - start_ < duration) {
      move();
      std::this_thread::sleep_for(milliseconds(10));
      if (robot_.state().phase != DrivesPhase::kFault) continue;
      std::printf("fault %s\n", robot_.fault_text().c_str());
      std::fflush(stdout);
      if (!recovers_) return kExitFault;
      if (!recover()) return kExitFault;
    }
    report();
    return kExitOk;
  }

 private:
  static void say(const char* name, double value) {
    std::printf("%s %.6f\n", name, value);
    std::fflush(stdout);
  }
  static int tell(const std::string& fault) {
    std::printf("fault %s\n", fault.c_str());
    return kExitFault;
  }

  void move() {
    const double t = seconds_of(clock_.monotonic() - start_);
    RobotCommand command;
    command.arm = RobotCommand::Arm::kPosition;
    for (std::size_t i = 0; i < rig_.joints.size(); ++i) {
      const JointRig& joint = rig_.joints[i];
      const double middle = 0.5 * (joint.lower_rad + joint.upper_rad);
      command.joints[i] = middle + kSwing * std::sin(2 * M_PI * t / kSwingPeriod_s + static_cast<double>(i));
    }
    command.base = {0.3, 0, 0.5};
    command.valid_until = clock_.monotonic() + milliseconds(200);
    robot_.command(command);
    const RobotState state = robot_.state();
    if (t < 5) return;  // on the way from the switches
    for (std::size_t i = 0; i < state.joints; ++i) {
      worst_error_ = std::max(worst_error_, std::abs(state.axis[i].following_error_rad));
    }
  }

  /// Tries for ten seconds: an interface may stay down for a while.
  bool recover() {
    const nanoseconds begin = clock_.monotonic();
    std::string fault;
    while (clock_.monotonic() - begin < seconds(10)) {
      fault = robot_.request(DriveRequest::kRecover);
      if (fault.empty()) fault = robot_.request(DriveRequest::kEnable);
      if (fault.empty()) {
        say("recovered_after", seconds_of(clock_.monotonic() - begin));
        return true;
      }
      std::this_thread::sleep_for(milliseconds(100));
    }
    tell("not recovered: " + fault);
    return false;
  }

  void report() {
    const RobotState state = robot_.state();
    const DriveFigures figures = robot_.figures();
    std::printf("punctuality %s\n", to_text(figures.punctuality).c_str());
    say("cycles", static_cast<double>(figures.punctuality.cycles()));
    say("missed", static_cast<double>(figures.punctuality.missed()));
    say("worst_lateness", seconds_of(figures.punctuality.worst()));
    say("cpu_share", figures.cpu_share);
    say("worst_following_error", worst_error_);
    say("turned", state.base.heading_rad);
    say("frames_lost", static_cast<double>(bus_->counters().overflowed));
  }

  SystemClock clock_;
  std::unique_ptr<can::CanBus> bus_;
  DrivesRig rig_;
  DriveThread robot_;
  bool recovers_;
  nanoseconds start_{0};
  double worst_error_ = 0;
};

}  // namespace
}  // namespace vantage

int main(int argc, char** argv) {
  return vantage::run_program("drive_robot", [&] {
    if (argc < 4) {
      std::fprintf(stderr, "usage: drive_robot BUS RIG SECONDS [recover]\n");
      return static_cast<int>(vantage::kExitBadInput);
    }
    const vantage::Rig rig = vantage::load_rig(argv[2]);
    vantage::Session session(argv[1], rig, argc > 4);
    return session.run(std::chrono::seconds(std::stoi(argv[3])));
  });
}
