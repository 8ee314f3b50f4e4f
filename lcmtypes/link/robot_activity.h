#pragma once

#include <cstdint>

namespace vantage {

/// What a robot says that it is doing: robot_state_t::activity.
enum class RobotActivity : std::int8_t {
  kIdle = 0,
  kMoving = 1,
  kCapturing = 2,
  kPaused = 3,  ///< goals wait for a resume; a trajectory is followed all the same
  kStopped = 4  ///< nothing is obeyed but a resume
};

/// Paused or stopped.
constexpr bool is_halted(std::int8_t activity) { return activity >= static_cast<std::int8_t>(RobotActivity::kPaused); }

}  // namespace vantage
