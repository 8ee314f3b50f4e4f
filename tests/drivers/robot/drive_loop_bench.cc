// What one cycle of nine axes costs this computer, and what share of a core that is at 100 Hz.

#include <cstdio>
#include <ctime>
#include <filesystem>
#include <string>

#include <benchmark/benchmark.h>
#include <unistd.h>

#include "calib/rig.h"
#include "drivers/can/open_can_bus.h"
#include "drivers/robot/robot_drives.h"
#include "drivers/sim/drive_service.h"

namespace vantage {
namespace {

constexpr double kPeriod_s = 0.01;

double thread_cpu_s() {
  timespec time{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

/// In real time over a Unix socket, one datagram a frame, as SocketCAN has one system call a frame too. The drives run
/// in a thread of their own, which is not counted.
void nine_axes_over_a_socket(benchmark::State& state) {
  char folder[] = "/tmp/bench-XXXXXX";
  if (::mkdtemp(folder) == nullptr) return state.SkipWithError("no folder");
  const std::string name = std::string("sim:") + folder + "/bus";
  const DrivesRig rig = *load_rig(VANTAGE_SOURCE_DIR "/calib/rigs/youbot.yaml").drives;
  {
    const sim::DriveService drives(name, rig, 1);
    const auto bus = can::open_can_bus(name);
    const SystemClock clock;
    RobotDrives robot(*bus, clock, rig);
    if (const std::string fault = robot.set_up(); !fault.empty()) state.SkipWithError(fault.c_str());
    const double begin = thread_cpu_s();
    for (auto _ : state) {
      const double cycle = thread_cpu_s();
      robot.cycle({});
      state.SetIterationTime(thread_cpu_s() - cycle);
    }
    const double share = (thread_cpu_s() - begin) / static_cast<double>(state.iterations()) / kPeriod_s;
    state.counters["core_share_at_100_Hz"] = share;
    std::printf("drive_loop_core_share %.4f\n", share);
  }
  std::filesystem::remove_all(folder);
}
BENCHMARK(nine_axes_over_a_socket)->UseManualTime()->Iterations(500)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace vantage

BENCHMARK_MAIN();
