#include "offboard/import/recording.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <map>

#include <opencv2/imgcodecs.hpp>

#include "calib/files/input_error.h"
#include "calib/files/trajectory.h"
#include "lcmtypes/link/depth_edges.h"

namespace vantage {
namespace {

namespace fs = std::filesystem;

constexpr double kSevenScenesRate_hz = 30;
constexpr std::uint16_t kNoDepthLow = 0, kNoDepthHigh = 65535;
constexpr const char* kDepthSuffix = ".depth.png";
constexpr const char* kPoseSuffix = ".pose.txt";

/// Files of a folder by name; empty when there is no such folder.
std::map<std::string, fs::path> files_of(const fs::path& folder) {
  std::map<std::string, fs::path> files;
  if (!fs::is_directory(folder)) return files;
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.is_regular_file()) files.emplace(entry.path().filename().string(), entry.path());
  }
  return files;
}

std::map<std::string, fs::path> with_suffix(const std::vector<fs::path>& folders, const std::string& suffix) {
  std::map<std::string, fs::path> found;  // by stem
  for (const fs::path& folder : folders) {
    for (const auto& [name, path] : files_of(folder)) {
      if (name.ends_with(suffix)) found.emplace(name.substr(0, name.size() - suffix.size()), path);
    }
    if (!found.empty()) break;
  }
  return found;
}

std::optional<double> number_at_end(const std::string& stem) {
  const std::size_t digits = stem.find_last_not_of("0123456789") + 1;
  int number = 0;
  const auto [end, error] = std::from_chars(stem.data() + digits, stem.data() + stem.size(), number);
  if (error != std::errc()) return std::nullopt;
  return number;
}

std::map<std::string, fs::path> seven_scenes_images(const fs::path& folder) {
  return with_suffix({folder, folder / "depth"}, kDepthSuffix);
}

void read_seven_scenes(const fs::path& folder, Recording* recording) {
  const auto images = seven_scenes_images(folder);
  const auto poses =
      with_suffix({folder, folder / "depth_pose", folder / "pose", folder / "poses", folder / "depth"}, kPoseSuffix);
  if (images.empty()) throw InputError(folder.string() + ": holds no frame-NNNNNN" + kDepthSuffix);
  for (const auto& [stem, image] : images) {
    const auto pose = poses.find(stem);
    if (pose == poses.end()) throw InputError(image.string() + ": there is no " + stem + kPoseSuffix + " for it");
    const std::optional<double> number = number_at_end(stem);
    if (!number) throw InputError(image.string() + ": its name does not end with the frame's number");
    recording->frames.push_back({*number / kSevenScenesRate_hz, image, read_matrix_pose(pose->second)});
  }
}

/// Gives each image the pose nearest in time.
void add_posed(const std::vector<StampedFile>& images, const std::vector<StampedPose>& poses, Recording* recording) {
  for (const StampedFile& image : images) {
    const StampedPose* nearest = nearest_pose(poses, image.time_s);
    if (nearest == nullptr) {
      ++recording->without_pose;
    } else {
      recording->frames.push_back({image.time_s, image.path, nearest->T_world_camera});
    }
  }
}

fs::path trajectory_of(const fs::path& folder) {
  for (const char* name : {"groundtruth.txt", "trajectory.txt"}) {
    if (fs::exists(folder / name)) return folder / name;
  }
  throw InputError(folder.string() + ": holds neither groundtruth.txt nor trajectory.txt (a TUM trajectory)");
}

void read_trajectory_layout(const fs::path& folder, Recording* recording) {
  std::vector<StampedFile> images;
  for (const auto& [stem, path] : with_suffix({folder / "depth", folder}, ".png")) {
    double time_s = 0;
    const auto [end, error] = std::from_chars(stem.data(), stem.data() + stem.size(), time_s);
    if (error != std::errc() || end != stem.data() + stem.size()) {
      throw InputError(path.string() +
                       ": its name is no time; depth images are named TIMESTAMP.png, or listed in depth.txt");
    }
    images.push_back({time_s, path});
  }
  std::sort(images.begin(), images.end(),
            [](const StampedFile& a, const StampedFile& b) { return a.time_s < b.time_s; });
  add_posed(images, read_tum_trajectory(trajectory_of(folder)), recording);
}

RecordingLayout layout_of(const fs::path& folder) {
  if (!seven_scenes_images(folder).empty()) return RecordingLayout::kSevenScenes;
  if (fs::exists(folder / "depth.txt")) return RecordingLayout::kTum;
  if (!with_suffix({folder / "depth", folder}, ".png").empty()) return RecordingLayout::kTrajectory;
  throw InputError(folder.string() +
                   ": holds no recording: neither frame-NNNNNN.depth.png (7-Scenes), nor depth.txt (TUM RGB-D), nor "
                   "TIMESTAMP.png depth images");
}

RecordingCamera camera_of(const fs::path& folder, RecordingLayout layout) {
  if (layout == RecordingLayout::kSevenScenes) {
    // A camera.yaml beside 7-Scenes images would be the colour camera's.
    return {{640, 480, 585, 585, 320, 240, Distortion::kNone, {}}, 0.001};
  }
  return load_recording_camera(folder / "camera.yaml");
}

}  // namespace

Recording open_recording(const fs::path& folder, std::optional<RecordingLayout> layout,
                         const std::optional<RecordingCamera>& camera) {
  if (!fs::is_directory(folder)) throw InputError(folder.string() + ": no such folder");
  Recording recording;
  recording.layout = layout ? *layout : layout_of(folder);
  recording.camera = camera ? *camera : camera_of(folder, recording.layout);
  if (recording.camera.camera.distortion != Distortion::kNone) {
    throw InputError(folder.string() + ": its depth camera has lens distortion; undistort the depth images first");
  }
  switch (recording.layout) {
    case RecordingLayout::kSevenScenes:
      read_seven_scenes(folder, &recording);
      break;
    case RecordingLayout::kTum:
      add_posed(read_file_list(folder / "depth.txt"), read_tum_trajectory(trajectory_of(folder)), &recording);
      break;
    case RecordingLayout::kTrajectory:
      read_trajectory_layout(folder, &recording);
      break;
  }
  if (recording.frames.empty()) {
    throw InputError(folder.string() + ": none of its " + std::to_string(recording.without_pose) +
                     " depth images has a pose within 20 ms");
  }
  return recording;
}

DepthMap read_recorded_depth(const RecordedDepth& frame, const RecordingCamera& camera, const DepthNoise& noise,
                             double max_depth_m) {
  const cv::Mat image = cv::imread(frame.image.string(), cv::IMREAD_UNCHANGED);
  if (image.empty()) throw InputError(frame.image.string() + ": no such image, or it can't be read");
  if (image.type() != CV_16UC1) throw InputError(frame.image.string() + ": is no 16-bit grey depth image");
  DepthMap map;
  map.camera = camera.camera;
  if (map.camera.width == 0) {
    map.camera.width = image.cols;
    map.camera.height = image.rows;
  }
  if (image.cols != map.camera.width || image.rows != map.camera.height) {
    throw InputError(frame.image.string() + ": is " + std::to_string(image.cols) + " x " + std::to_string(image.rows) +
                     " pixels, the recording's camera " + std::to_string(map.camera.width) + " x " +
                     std::to_string(map.camera.height));
  }
  map.utime = std::llround(frame.time_s * 1e6);
  map.T_world_camera = frame.T_world_camera;
  for (int v = 0; v < image.rows; ++v) {
    for (int u = 0; u < image.cols; ++u) {
      const std::uint16_t raw = image.at<std::uint16_t>(v, u);
      const double depth = raw * camera.depth_unit_m;
      const bool measured = raw != kNoDepthLow && raw != kNoDepthHigh && depth <= max_depth_m;
      const double sigma = std::max(noise.least_sigma_m, noise.sigma_at_1m * depth * depth);
      map.depth_m.push_back(measured ? static_cast<float>(depth) : 0);
      map.sigma_m.push_back(measured ? static_cast<float>(sigma) : 0);
      map.state.push_back(measured ? DepthState::kConverged : DepthState::kInvalid);
    }
  }
  mark_depth_edges(&map, {.radius_px = 2});
  return map;
}

}  // namespace vantage
