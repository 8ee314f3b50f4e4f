#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "drivers/robot/flight_recorder.h"
#include "drivers/robot/latest_value.h"
#include "drivers/robot/realtime.h"
#include "drivers/robot/robot_drives.h"

namespace vantage {

/// What the loop may be asked for between cycles.
enum class DriveRequest { kSetUp, kHome, kEnable, kDisable, kRecover };

struct DriveThreadOptions {
  int priority = 80;                 ///< of SCHED_FIFO
  std::chrono::seconds recorded{5};  ///< before a fault
  std::chrono::milliseconds recorded_after{500};
};

/// Figures of the loop since it started, or since `clear_figures`.
struct DriveFigures {
  CycleStatistics punctuality;
  double cpu_share = 0;  ///< of one core, that the loop's thread has used
};

/// Runs RobotDrives in a thread of its own, on SCHED_FIFO where that is allowed.
///
/// While nothing is asked the loop neither locks nor allocates: commands and states pass through LatestValue. A request
/// blocks its caller until it is done; cycles, and with them the heartbeat, go on meanwhile.
class DriveThread {
 public:
  /// Bus and clock must outlive it. \throws as RobotDrives.
  DriveThread(can::CanBus& bus, const Clock& clock, const DrivesRig& rig, const DriveThreadOptions& options = {});
  /// Switches the drives off, when they are on and still listen.
  ~DriveThread();
  DriveThread(const DriveThread&) = delete;
  DriveThread& operator=(const DriveThread&) = delete;

  /// Carries a request out. The fault in one line, or nothing.
  std::string request(DriveRequest request);
  /// By one thread: what the loop should do from its next cycle on.
  void command(const RobotCommand& command) { command_.write(command); }
  /// By one thread: the latest cycle.
  RobotState state();
  /// Why everything was stopped; empty when nothing was.
  std::string fault_text();
  DriveFigures figures();
  void clear_figures();
  const RealtimeState& realtime() const { return realtime_; }
  /// The last seconds before a fault, once `complete`.
  FlightRecorder& recorder() { return recorder_; }

 private:
  enum class Question { kNone, kRequest, kFaultText, kFigures, kClearFigures, kStop };

  void run();
  void answer();
  std::string ask(Question question);
  std::string carry_out(DriveRequest request);

  RobotDrives drives_;
  FlightRecorder recorder_;
  int priority_;
  RealtimeState realtime_;
  LatestValue<RobotCommand> command_;
  LatestValue<RobotState> state_;

  std::mutex asking_;  // one caller at a time
  std::atomic<Question> question_{Question::kNone};
  DriveRequest request_ = DriveRequest::kSetUp;  // written before the question is set, read after
  std::mutex mutex_;                             // guards the three below
  std::condition_variable answered_;
  bool ready_ = false;
  std::string answer_;
  DriveFigures figures_;

  // Of the loop's own.
  std::chrono::nanoseconds figures_since_{0}, cpu_since_{0};

  std::thread thread_;
};

}  // namespace vantage
