#include "onboard/tracking/endurance_run.h"

#include <cmath>
#include <fstream>

#include <fmt/format.h>
#include <unistd.h>

namespace vantage::tracking {
namespace {

/// Of this process, from /proc/self/statm; 0 when there is none.
double resident_mb() {
  std::ifstream file("/proc/self/statm");
  long all = 0, resident = 0;
  if (!(file >> all >> resident)) return 0;
  return static_cast<double>(resident) * static_cast<double>(::sysconf(_SC_PAGESIZE)) / (1024.0 * 1024.0);
}

}  // namespace

void run_rounds(const Recording& recording, const TrackerOptions& options, int rounds,
                const std::function<void(const RoundReport&)>& report) {
  std::vector<Frame> images;
  for (std::size_t i = 0; i < recording.images.size(); ++i) images.push_back(read_frame(recording, i));
  const double first_s = recording.images.front().time_s, length_s = recording.images.back().time_s - first_s;
  // A round takes one step more than from its first frame to its last.
  const double steps = std::max<double>(1, static_cast<double>(images.size()) - 1);
  const double round_s = length_s > 0 ? length_s * (steps + 1) / steps : 1;
  Tracker tracker(recording.camera, options);
  for (int round = 1; round <= rounds; ++round) {
    RoundReport done;
    done.round = round;
    std::vector<StampedPose> trajectory;
    std::vector<TrackingResult> results;
    for (std::size_t i = 0; i < images.size(); ++i) {
      Frame frame = images[i];
      frame.sequence += static_cast<std::uint64_t>(round - 1) * images.size();
      frame.capture_time_ns += std::llround((round - 1) * round_s * 1e9);
      results.push_back(tracker.process(frame, prior_at(recording, recording.images[i].time_s)));
      done.losses += results.back().state == TrackingState::kLost;
    }
    tracker.finish();
    for (std::size_t i = 0; i < images.size(); ++i) {
      if (const auto pose = tracker.pose_of(results[i])) trajectory.push_back({recording.images[i].time_s, *pose});
    }
    done.frames = images.size();
    done.tracked = trajectory.size();
    done.map = tracker.mapper().size();
    done.resident_mb = resident_mb();
    if (!recording.truth.empty()) done.error = trajectory_error(trajectory, recording.truth, true);
    report(done);
  }
}

std::string to_json(const RoundReport& r) {
  std::string json =
      fmt::format(R"({{"round": {}, "frames": {}, "tracked": {}, "losses": {}, "key_frames": {}, "landmarks": {}, )"
                  R"("observations": {}, "heirs": {}, "corrections": {}, "resident_mb": {:.1f})",
                  r.round, r.frames, r.tracked, r.losses, r.map.key_frames, r.map.landmarks, r.map.observations,
                  r.map.heirs, r.map.corrections, r.resident_mb);
  if (r.error && r.error->poses >= 3) json += fmt::format(R"(, "ate_m": {:.5f})", r.error->rmse_m);
  return json + "}";
}

}  // namespace vantage::tracking
