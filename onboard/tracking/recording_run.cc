#include "onboard/tracking/recording_run.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <deque>
#include <map>
#include <mutex>
#include <random>
#include <thread>

#include <fmt/format.h>
#include <opencv2/imgcodecs.hpp>
#include <time.h>

#include "calib/files/atomic_file.h"
#include "calib/files/input_error.h"
#include "calib/rig.h"

namespace vantage::tracking {
namespace {

using Seconds = std::chrono::duration<double>;

constexpr double kSameTime_s = 0.005;  // between a frame and what the robot said of it

/// Reads images ahead of their time in a thread of its own, so that the disk is not measured.
class Reader {
 public:
  explicit Reader(const Recording& recording) : recording_(recording), thread_([this] { work(); }) {}
  ~Reader() {
    {
      const std::lock_guard lock(mutex_);
      stop_ = true;
    }
    wake_.notify_all();
    thread_.join();
  }

  Frame next() {
    std::unique_lock lock(mutex_);
    wake_.wait(lock, [this] { return !frames_.empty() || error_; });
    if (frames_.empty()) std::rethrow_exception(error_);
    Frame frame = std::move(frames_.front());
    frames_.pop_front();
    wake_.notify_all();
    return frame;
  }

 private:
  static constexpr std::size_t kAhead = 8;

  void work() {
    for (std::size_t i = 0; i < recording_.images.size(); ++i) {
      Frame frame;
      try {
        frame = read_frame(recording_, i);
      } catch (...) {
        const std::lock_guard lock(mutex_);
        error_ = std::current_exception();
        wake_.notify_all();
        return;
      }
      std::unique_lock lock(mutex_);
      wake_.wait(lock, [this] { return stop_ || frames_.size() < kAhead; });
      if (stop_) return;
      frames_.push_back(std::move(frame));
      wake_.notify_all();
    }
  }

  const Recording& recording_;
  std::mutex mutex_;  // guards the members below
  std::condition_variable wake_;
  std::deque<Frame> frames_;
  std::exception_ptr error_;
  bool stop_ = false;
  std::thread thread_;
};

/// Seeks frames without a pose from their posed neighbours outwards: backward in time first, from where a map began or
/// the camera was found again, then forward.
void look_again(const Recording& recording, Tracker* tracker, std::vector<FrameRecord>* frames) {
  const auto count = static_cast<std::ptrdiff_t>(frames->size());
  const auto pass = [&](std::ptrdiff_t first, std::ptrdiff_t last, std::ptrdiff_t step) {
    for (std::ptrdiff_t i = first; i != last; i += step) {
      FrameRecord& record = (*frames)[static_cast<std::size_t>(i)];
      const std::ptrdiff_t beside = i - step;
      if (record.result.has_pose || beside < 0 || beside >= count) continue;
      const FrameRecord& neighbour = (*frames)[static_cast<std::size_t>(beside)];
      if (!neighbour.result.has_pose) continue;
      const Frame frame = read_frame(recording, static_cast<std::size_t>(i));
      const Frame neighbour_frame = read_frame(recording, static_cast<std::size_t>(beside));
      const TrackingResult found = tracker->locate(frame, &neighbour.result, &neighbour_frame);
      if (!found.has_pose) continue;
      record.result = found;
      record.afterwards = true;
    }
  };
  pass(count - 1, -1, -1);
  pass(0, count, 1);
  for (std::ptrdiff_t i = 0; i < count; ++i) {
    FrameRecord& record = (*frames)[static_cast<std::size_t>(i)];
    if (record.result.has_pose) continue;
    const TrackingResult found = tracker->locate(read_frame(recording, static_cast<std::size_t>(i)), nullptr, nullptr);
    if (!found.has_pose) continue;
    record.result = found;
    record.afterwards = true;
  }
}

/// Processor time that this thread has had.
double thread_seconds() {
  timespec time{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

double percentile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

void note(const FrameRecord& record, RunSummary* summary) {
  if (record.result.has_pose && summary->first_pose < 0) {
    summary->first_pose = static_cast<int>(summary->frames.size());
  }
  summary->losses += record.result.state == TrackingState::kLost;
  summary->relocalised += record.result.relocalised;
  summary->frames.push_back(record);
}

void take_trajectory(Tracker* tracker, RunSummary* summary) {
  // Pieces of map that were never joined have nothing in common: the one with most frames is the trajectory.
  std::map<int, int> frames_in;
  for (const FrameRecord& record : summary->frames) {
    if (record.result.has_pose) ++frames_in[tracker->piece_of(record.result)];
  }
  int largest = 0, most = 0;
  for (const auto& [piece, count] : frames_in) {
    if (count > most) {
      most = count;
      largest = piece;
    }
  }
  summary->pieces = static_cast<int>(frames_in.size());
  summary->loops = tracker->mapper().loops_closed();
  for (FrameRecord& record : summary->frames) {
    if (!record.result.has_pose) continue;
    const auto pose = tracker->pose_of(record.result);
    if (!pose || tracker->piece_of(record.result) != largest) {
      record.result.has_pose = false;
      continue;
    }
    record.result.T_world_camera = *pose;
    summary->trajectory.push_back({record.time_s, *pose});
  }
}

}  // namespace

Recording open_recording(const std::filesystem::path& folder) {
  Recording recording;
  if (!std::filesystem::is_directory(folder)) throw InputError(folder.string() + ": no such folder");
  recording.camera = load_recording_camera(folder / "camera.yaml").camera;
  recording.images = read_file_list(folder / "rgb.txt");
  if (recording.images.empty()) throw InputError((folder / "rgb.txt").string() + ": names no image");
  if (std::filesystem::exists(folder / "groundtruth.txt")) {
    recording.truth = read_tum_trajectory(folder / "groundtruth.txt");
  }
  if (recording.camera.width == 0) {
    const cv::Mat image = cv::imread(recording.images.front().path.string(), cv::IMREAD_GRAYSCALE);
    if (image.empty()) throw InputError(recording.images.front().path.string() + ": not an image that can be read");
    recording.camera.width = image.cols;
    recording.camera.height = image.rows;
  }
  std::string why;
  if (!recording.camera.valid(&why)) throw InputError((folder / "camera.yaml").string() + ": " + why);
  return recording;
}

Frame read_frame(const Recording& recording, std::size_t i) {
  const StampedFile& file = recording.images[i];
  auto image = std::make_shared<cv::Mat>(cv::imread(file.path.string(), cv::IMREAD_GRAYSCALE));
  if (image->empty()) throw InputError(file.path.string() + ": not an image that can be read");
  if (image->cols != recording.camera.width || image->rows != recording.camera.height) {
    throw InputError(fmt::format("{}: is {} x {} pixels, the camera {} x {}", file.path.string(), image->cols,
                                 image->rows, recording.camera.width, recording.camera.height));
  }
  Frame frame;
  frame.sequence = i;
  frame.capture_time_ns = std::llround(file.time_s * 1e9);
  frame.image.width = image->cols;
  frame.image.height = image->rows;
  frame.image.stride = static_cast<std::ptrdiff_t>(image->step);
  frame.image.pixels = {image, image->data};
  return frame;
}

std::optional<PosePrior> prior_at(const Recording& recording, double time_s) {
  const StampedPose* pose = nearest_pose(recording.kinematics, time_s, kSameTime_s);
  if (pose == nullptr) return std::nullopt;
  return PosePrior{pose->T_world_camera, recording.kinematics_sigma_m, recording.kinematics_sigma_rad};
}

std::vector<StampedPose> with_noise(const std::vector<StampedPose>& truth, double sigma_m, double sigma_rad,
                                    std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  const auto vector = [&](double sigma) {
    const double x = normal(random), y = normal(random), z = normal(random);
    return Eigen::Vector3d(sigma * x, sigma * y, sigma * z);
  };
  std::vector<StampedPose> noisy = truth;
  for (StampedPose& pose : noisy) {
    pose.T_world_camera.translation() += vector(sigma_m);
    pose.T_world_camera.linear() = pose.T_world_camera.linear() * rotation_exp(vector(sigma_rad)).toRotationMatrix();
  }
  return noisy;
}

RunSummary run_recording(const Recording& recording, const TrackerOptions& tracker_options, const RunOptions& options) {
  RunSummary summary;
  Tracker tracker(recording.camera, tracker_options);
  std::vector<double> times, processor_times;
  {
    Reader reader(recording);
    const auto begin = std::chrono::steady_clock::now();
    for (std::size_t i = 0; i < recording.images.size(); ++i) {
      const Frame frame = reader.next();
      FrameRecord record;
      record.time_s = recording.images[i].time_s;
      record.result.sequence = frame.sequence;
      if (options.realtime_fps > 0) {
        // A camera's newest picture replaces one that nobody has fetched: this one is gone if the next is there
        // already.
        const auto due = begin + Seconds(static_cast<double>(i) / options.realtime_fps);
        const auto next = begin + Seconds(static_cast<double>(i + 1) / options.realtime_fps);
        if (std::chrono::steady_clock::now() >= next) {
          record.dropped = true;
          summary.frames.push_back(record);
          continue;
        }
        std::this_thread::sleep_until(due);
      }
      const double cpu_from = thread_seconds();
      const auto from = std::chrono::steady_clock::now();
      record.result = tracker.process(frame, prior_at(recording, record.time_s));
      record.seconds = Seconds(std::chrono::steady_clock::now() - from).count();
      times.push_back(1e3 * record.seconds);
      processor_times.push_back(1e3 * (thread_seconds() - cpu_from));
      note(record, &summary);
    }
  }
  tracker.finish();
  for (FrameRecord& record : summary.frames) {  // of a start that was undone
    if (record.result.has_pose && !tracker.pose_of(record.result)) record.result.has_pose = false;
  }
  if (options.second_look) look_again(recording, &tracker, &summary.frames);
  take_trajectory(&tracker, &summary);
  summary.ms_median = percentile(times, 0.5);
  summary.ms_p95 = percentile(times, 0.95);
  summary.cpu_ms_median = percentile(processor_times, 0.5);
  if (!recording.truth.empty()) {
    constexpr double kWindowFrames = 200;
    const double frames = static_cast<double>(std::max<std::size_t>(2, recording.images.size()) - 1);
    const double window_s = kWindowFrames * (recording.images.back().time_s - recording.images.front().time_s) / frames;
    summary.similar = trajectory_error(summary.trajectory, recording.truth, true, window_s,
                                       static_cast<std::size_t>(kWindowFrames / 2));
    summary.rigid = trajectory_error(summary.trajectory, recording.truth, false);
  }
  return summary;
}

RunSummary run_source(FrameSource* source, const CameraModel& camera, const TrackerOptions& tracker_options, int frames,
                      const std::atomic<bool>& stop) {
  RunSummary summary;
  Tracker tracker(camera, tracker_options);
  std::vector<double> times, processor_times;
  while (!stop && (frames == 0 || static_cast<int>(summary.frames.size()) < frames)) {
    Frame frame;
    const FrameStatus status = source->next(&frame, std::chrono::milliseconds(200));
    if (status == FrameStatus::kEnded) break;
    if (status == FrameStatus::kTimeout) continue;
    FrameRecord record;
    record.time_s = static_cast<double>(frame.capture_time_ns) * 1e-9;
    const double cpu_from = thread_seconds();
    const auto from = std::chrono::steady_clock::now();
    record.result = tracker.process(frame);
    record.seconds = Seconds(std::chrono::steady_clock::now() - from).count();
    times.push_back(1e3 * record.seconds);
    processor_times.push_back(1e3 * (thread_seconds() - cpu_from));
    note(record, &summary);
  }
  tracker.finish();
  take_trajectory(&tracker, &summary);
  summary.ms_median = percentile(times, 0.5);
  summary.ms_p95 = percentile(times, 0.95);
  summary.cpu_ms_median = percentile(processor_times, 0.5);
  return summary;
}

std::string to_json(const RunSummary& s) {
  std::string json = fmt::format(
      R"({{"frames": {}, "tracked": {}, "tracked_at_once": {}, "first_pose": {}, "losses": {}, "relocalised": {}, )"
      R"("ms_median": {:.3f}, "ms_p95": {:.3f}, "cpu_ms_median": {:.3f})",
      s.frames.size(), s.trajectory.size(),
      std::count_if(s.frames.begin(), s.frames.end(),
                    [](const FrameRecord& f) { return f.result.has_pose && !f.afterwards; }),
      s.first_pose, s.losses, s.relocalised, s.ms_median, s.ms_p95, s.cpu_ms_median);
  if (s.similar && s.similar->poses >= 3) {
    json += fmt::format(
        R"(, "ate_m": {:.5f}, "ate_se3_m": {:.5f}, "ate_worst_window_m": {:.5f}, "ate_mean_window_m": {:.5f}, "path_m": {:.4f}, )"
        R"("scale": {:.5f})",
        s.similar->rmse_m, s.rigid->rmse_m, s.similar->worst_window_m, s.similar->mean_window_m, s.similar->path_m,
        s.similar->scale);
  } else {
    double path = 0;
    for (std::size_t i = 1; i < s.trajectory.size(); ++i) {
      path += (s.trajectory[i].T_world_camera.translation() - s.trajectory[i - 1].T_world_camera.translation()).norm();
    }
    json += fmt::format(R"(, "ate_m": null, "path_m": {:.4f}, "scale": null)", path);
  }
  return json + fmt::format(R"(, "pieces": {}, "loops": {}}})", s.pieces, s.loops);
}

void write_states(const std::filesystem::path& path, const RunSummary& summary) {
  AtomicFile file(path);
  file.stream() << "# time_s state points ms has_pose afterwards relocalised\n";
  for (const FrameRecord& f : summary.frames) {
    file.stream() << fmt::format("{:.6f} {} {} {:.3f} {:d} {:d} {:d}\n", f.time_s,
                                 f.dropped ? "dropped" : name_of(f.result.state), f.result.points, 1e3 * f.seconds,
                                 f.result.has_pose, f.afterwards, f.result.relocalised);
  }
  file.commit();
}

}  // namespace vantage::tracking
