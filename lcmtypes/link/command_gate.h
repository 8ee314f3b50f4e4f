#pragma once

#include <chrono>
#include <cstdint>

#include <vantage/command_t.hpp>

namespace vantage {

enum class CommandKind : std::int8_t { kGoal = 0, kStop = 1, kPause = 2, kResume = 3, kTrajectory = 4 };

/// The longest a command may be valid for: whoever holds one back can't use it later.
inline constexpr std::chrono::seconds kLongestCommandLife{10};

/// Decides which commands the robot obeys: those meant for this start of it, not yet expired by its own clock, each
/// with a counter above all before (so that none is obeyed twice, nor after a later one).
///
/// A stop is obeyed whatever its robot, counter and expiry: a stop refused can do harm, a stop repeated only makes the
/// robot stand still. On a sealed bus it still takes a valid key.
class CommandGate {
 public:
  struct Counters {
    std::uint64_t accepted = 0;
    std::uint64_t other_robot = 0;  ///< meant for another robot, or for an earlier start of this one
    std::uint64_t not_rising = 0;   ///< replayed, doubled or overtaken
    std::uint64_t expired = 0;
    std::uint64_t too_long = 0;      ///< valid for longer than kLongestCommandLife
    std::uint64_t unknown_kind = 0;  ///< not in CommandKind, or with a payload where none belongs

    std::uint64_t refused() const { return other_robot + not_rising + expired + too_long + unknown_kind; }
  };

  /// `robot`: boot id of this start of the program.
  explicit CommandGate(std::int64_t robot) : robot_(robot) {}

  /// True when the command is to be obeyed; else the reason is counted. `now`: the robot's clock, us since 1970.
  bool admit(const command_t& command, std::int64_t now);

  /// Of the last command that was admitted; 0 before the first.
  std::int64_t counter() const { return counter_; }
  const Counters& counters() const { return counters_; }

 private:
  std::int64_t robot_;
  std::int64_t counter_ = 0;
  Counters counters_;
};

}  // namespace vantage
