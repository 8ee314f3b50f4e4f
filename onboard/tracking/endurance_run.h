#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <vector>

#include "onboard/tracking/recording_run.h"

namespace vantage::tracking {

/// What a tracker holds, and what came of the frames, after one round of a recording.
struct RoundReport {
  int round = 0;  ///< from 1
  std::size_t frames = 0, tracked = 0;
  int losses = 0;
  MapSize map;
  double resident_mb = 0;                ///< of the whole process, images of the recording included
  std::optional<TrajectoryError> error;  ///< of this round alone, Sim(3), against the truth
};

/// Runs one tracker over a recording again and again, as a robot that circles an object for an hour: to see that what
/// it holds stays bounded. The recording should end where it begins; if it does not, each round begins with a jump. Its
/// images are read once and kept; time goes on from round to round. `report` is called after each round.
/// \throws InputError for an image that can't be read.
void run_rounds(const Recording& recording, const TrackerOptions& options, int rounds,
                const std::function<void(const RoundReport&)>& report);

/// The figures as one line of JSON.
std::string to_json(const RoundReport& report);

}  // namespace vantage::tracking
