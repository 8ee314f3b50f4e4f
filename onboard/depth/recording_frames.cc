#include "onboard/depth/recording_frames.h"

#include <cmath>

#include <opencv2/imgcodecs.hpp>

#include "calib/files/input_error.h"
#include "calib/rig.h"

namespace vantage {

namespace {

constexpr double kLargestTimeGap_s = 0.02;

cv::Mat read_image(const std::filesystem::path& path, int flags) {
  cv::Mat image = cv::imread(path.string(), flags);
  if (image.empty()) throw InputError(path.string() + ": is no image that can be read");
  return image;
}

}  // namespace

RecordingFrames::RecordingFrames(const std::filesystem::path& folder) : folder_(folder) {
  const RecordingCamera recording = load_recording_camera(folder / "camera.yaml");
  depth_unit_m_ = recording.depth_unit_m;
  images_ = read_file_list(folder / "rgb.txt");
  if (images_.empty()) throw InputError((folder / "rgb.txt").string() + ": lists no image");
  const bool has_truth = std::filesystem::exists(folder / "groundtruth.txt");
  poses_ = read_tum_trajectory(folder / (has_truth ? "groundtruth.txt" : "trajectory.txt"));
  if (std::filesystem::exists(folder / "depth.txt")) depths_ = read_file_list(folder / "depth.txt");

  CameraModel lens = recording.camera;
  const cv::Mat first = read_image(images_.front().path, cv::IMREAD_GRAYSCALE);
  if (lens.width == 0) {
    lens.width = first.cols;
    lens.height = first.rows;
  }
  if (lens.width != first.cols || lens.height != first.rows) {
    throw InputError(images_.front().path.string() + ": is " + std::to_string(first.cols) + " x " +
                     std::to_string(first.rows) + ", camera.yaml says " + std::to_string(lens.width) + " x " +
                     std::to_string(lens.height));
  }
  undistorter_ = std::make_unique<Undistorter>(lens);
  pinhole_ = undistorter_->pinhole();
}

RecordingFrames::~RecordingFrames() = default;

std::optional<PosedImage> RecordingFrames::frame(int index) const {
  const StampedFile& file = images_.at(static_cast<std::size_t>(index));
  const StampedPose* pose = nearest_pose(poses_, file.time_s, kLargestTimeGap_s);
  if (pose == nullptr) return std::nullopt;
  const cv::Mat image = read_image(file.path, cv::IMREAD_GRAYSCALE);
  if (image.cols != pinhole_.width || image.rows != pinhole_.height) {
    throw InputError(file.path.string() + ": has another size than the recording's first image");
  }
  PosedImage frame;
  frame.capture_time_ns = std::llround(file.time_s * 1e9);
  frame.image = undistorter_->undistort({.width = image.cols,
                                         .height = image.rows,
                                         .stride = static_cast<std::ptrdiff_t>(image.step),
                                         .pixels = {image.datastart, [](const std::uint8_t*) {}}});
  frame.T_world_camera = pose->T_world_camera;
  return frame;
}

std::vector<float> RecordingFrames::true_depth(int index) const {
  const double time_s = images_.at(static_cast<std::size_t>(index)).time_s;
  const StampedFile* nearest = nullptr;
  for (const StampedFile& file : depths_) {
    const double gap_s = std::abs(file.time_s - time_s);
    if (gap_s <= kLargestTimeGap_s && (nearest == nullptr || gap_s < std::abs(nearest->time_s - time_s))) {
      nearest = &file;
    }
  }
  if (nearest == nullptr) return {};
  const cv::Mat image = read_image(nearest->path, cv::IMREAD_UNCHANGED);
  if (image.type() != CV_16UC1 || image.cols != pinhole_.width || image.rows != pinhole_.height) {
    throw InputError(nearest->path.string() + ": must be a 16-bit image of one channel, as large as the images");
  }
  std::vector<float> depth_m;
  depth_m.reserve(image.total());
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      const std::uint16_t steps = image.at<std::uint16_t>(y, x);
      depth_m.push_back(steps == 65535 ? 0.0F : static_cast<float>(steps * depth_unit_m_));
    }
  }
  return depth_m;
}

}  // namespace vantage
