#pragma once

#include <atomic>
#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "drivers/robot/robot_state.h"

namespace vantage {

/// The last seconds of a robot's states. `record` allocates nothing and never waits; after a fault it goes on for a
/// moment and then stands still, so that another thread can write the file.
class FlightRecorder {
 public:
  /// `cycles` before a fault and `after` behind it are kept.
  FlightRecorder(std::size_t cycles, std::size_t after);

  /// By the loop alone.
  void record(const RobotState& state);
  /// True when a fault and what followed it are complete, until `resume`. For any thread.
  bool complete() const { return complete_.load(std::memory_order_acquire); }
  /// Writes the states, oldest first, as CSV: time_s, cycle, phase, then position, speed, following error and drive
  /// state of every axis, and the base's pose. \pre complete(). \throws InputError when the file can't be written.
  void write(const std::filesystem::path& path) const;
  /// Begins anew; what was recorded is lost.
  void resume();

 private:
  std::vector<RobotState> ring_;
  std::size_t next_ = 0, count_ = 0;
  std::size_t after_, left_ = 0;  // states still to record after a fault
  bool in_fault_ = false;
  std::atomic<bool> complete_{false};
};

}  // namespace vantage
