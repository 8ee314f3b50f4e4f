#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "calib/camera_model.h"
#include "calib/files/trajectory.h"
#include "onboard/tracking/tracker.h"
#include "onboard/tracking/trajectory_error.h"

namespace vantage::tracking {

/// A recording in TUM layout, and where the robot said the camera was.
struct Recording {
  CameraModel camera;
  std::vector<StampedFile> images;
  std::vector<StampedPose> truth;       ///< empty when there is none
  std::vector<StampedPose> kinematics;  ///< empty: hand-held
  double kinematics_sigma_m = 0.002, kinematics_sigma_rad = 0.0035;
};

/// rgb.txt, camera.yaml and, when it is there, groundtruth.txt. \throws InputError.
Recording open_recording(const std::filesystem::path& folder);

/// Image `i` as a frame; its sequence number is `i`. \throws InputError when it can't be read or has another size.
Frame read_frame(const Recording& recording, std::size_t i);

/// What the robot said at that time; none when it is hand-held or said nothing.
std::optional<PosePrior> prior_at(const Recording& recording, double time_s);

/// Poses with independent noise a pose, as a robot's kinematics would give them.
std::vector<StampedPose> with_noise(const std::vector<StampedPose>& truth, double sigma_m, double sigma_rad,
                                    std::uint64_t seed);

struct RunOptions {
  double realtime_fps = 0;  ///< frames come at this rate, whether the tracker is ready or not; 0: one after the other
  bool second_look = true;  ///< frames that had no pose are sought in the finished map
};

/// What came of one frame.
struct FrameRecord {
  double time_s = 0;
  TrackingResult result;
  double seconds = 0;       ///< of Tracker::process
  bool dropped = false;     ///< never seen: the tracker was not ready
  bool afterwards = false;  ///< the pose was found by the second look
};

struct RunSummary {
  std::vector<FrameRecord> frames;
  std::vector<StampedPose> trajectory;  ///< of the largest piece of map
  int first_pose = -1;                  ///< the first frame that had a pose when it came
  int losses = 0, relocalised = 0, pieces = 0, loops = 0;
  double ms_median = 0, ms_p95 = 0;
  double cpu_ms_median = 0;  ///< processor time of the tracking thread: what is left of ms on an idle machine
  std::optional<TrajectoryError> similar;  ///< against the truth, aligned with a scale
  std::optional<TrajectoryError> rigid;    ///< without
};

/// Runs the tracker over a recording. \throws InputError for an image that can't be read.
RunSummary run_recording(const Recording& recording, const TrackerOptions& tracker, const RunOptions& options);

/// Runs the tracker over whatever a source gives, until it ends, `stop` is set, or `frames` have come (0: no limit).
RunSummary run_source(FrameSource* source, const CameraModel& camera, const TrackerOptions& tracker, int frames,
                      const std::atomic<bool>& stop);

/// The figures as one line of JSON.
std::string to_json(const RunSummary& summary);

/// "time state points ms afterwards", one line a frame. \throws InputError when it can't be written.
void write_states(const std::filesystem::path& path, const RunSummary& summary);

}  // namespace vantage::tracking
