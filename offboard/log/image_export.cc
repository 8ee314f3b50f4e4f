#include "offboard/log/image_export.h"

#include <cmath>
#include <fstream>
#include <optional>
#include <set>
#include <system_error>
#include <vector>

#include <fmt/format.h>
#include <opencv2/imgcodecs.hpp>
#include <unistd.h>

#include "calib/files/atomic_file.h"
#include "calib/files/input_error.h"
#include "calib/files/trajectory.h"
#include "offboard/log/log_maps.h"
#include "offboard/log/state_colors.h"

namespace vantage {
namespace {

namespace fs = std::filesystem;

constexpr const char* kEntries[] = {"depth", "sigma", "state", "depth.txt", "groundtruth.txt", "camera.yaml"};

/// A folder that takes its name's place, or gives its files to a folder that has it, when it is complete.
class PendingFolder {
 public:
  PendingFolder(fs::path folder, bool overwrite) : folder_(std::move(folder)), temporary_(folder_) {
    if (!folder_.has_filename()) folder_ = temporary_ = folder_.parent_path();
    std::error_code error;
    if (fs::exists(folder_, error) && !fs::is_directory(folder_, error)) {
      throw InputError(folder_.string() + ": is a file; give a folder");
    }
    if (fs::exists(folder_, error) && !fs::is_empty(folder_, error) && !overwrite) {
      throw InputError(folder_.string() + ": is not empty; give another folder, or --overwrite");
    }
    temporary_ += ".tmp-" + std::to_string(::getpid());
    fs::create_directory(temporary_, error);
    if (error) throw InputError(folder_.string() + ": can't be made: " + error.message());
  }
  ~PendingFolder() {
    std::error_code ignored;
    fs::remove_all(temporary_, ignored);
  }
  const fs::path& path() const { return temporary_; }

  void commit() {
    std::error_code error;
    fs::create_directory(folder_, error);
    for (const char* entry : kEntries) {
      if (!error) fs::remove_all(folder_ / entry, error);
      if (!error) fs::rename(temporary_ / entry, folder_ / entry, error);
      if (error) throw InputError((folder_ / entry).string() + ": can't be put in place: " + error.message());
    }
  }

 private:
  fs::path folder_, temporary_;
};

void write_image(const fs::path& path, const cv::Mat& image) {
  bool written = false;
  try {
    written = cv::imwrite(path.string(), image);
  } catch (const cv::Exception&) {
  }
  if (!written) throw InputError(path.string() + ": can't be written; is the disk full?");
}

/// 16-bit image of the pixels that `shown` names; the smallest value is 1, for 0 means none.
template <typename Shown>
cv::Mat steps_image(const DepthMap& map, const std::vector<float>& values, double step, Shown shown,
                    std::int64_t* too_far) {
  cv::Mat image(map.camera.height, map.camera.width, CV_16UC1, cv::Scalar(0));
  auto* out = image.ptr<std::uint16_t>();
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!shown(map.state[i])) continue;
    const double steps = std::round(static_cast<double>(values[i]) / step);
    if (steps >= 65535) {  // which stands for "none" in some recordings
      ++*too_far;
    } else {
      out[i] = static_cast<std::uint16_t>(std::max(steps, 1.0));
    }
  }
  return image;
}

cv::Mat state_image(const DepthMap& map) {
  cv::Mat image(map.camera.height, map.camera.width, CV_8UC3);
  for (std::size_t i = 0; i < map.state.size(); ++i) {
    const std::array<std::uint8_t, 3> color = color_of(map.state[i]);
    for (std::size_t c = 0; c < 3; ++c) image.data[3 * i + c] = color[2 - c];  // OpenCV: blue first
  }
  return image;
}

}  // namespace

ImageExport export_images(const fs::path& log, const fs::path& folder, bool overwrite) {
  PendingFolder pending(folder, overwrite);
  const fs::path& root = pending.path();
  for (const char* images : {"depth", "sigma", "state"}) fs::create_directory(root / images);
  ImageExport result;
  std::optional<CameraModel> camera;
  std::vector<StampedPose> poses;
  std::set<std::int64_t> times;
  for_each_depth_map(log, [&](const DepthMap& map) {
    const CameraModel& now = map.camera;
    if (!camera) camera = now;
    const bool same = now.width == camera->width && now.height == camera->height && now.fx == camera->fx &&
                      now.fy == camera->fy && now.cx == camera->cx && now.cy == camera->cy;
    if (!same) {
      throw InputError(log.string() +
                       ": its depth maps come from different cameras, and a recording has one; cut it in parts");
    }
    if (!times.insert(map.utime).second) {
      throw InputError(log.string() +
                       fmt::format(": two depth maps have the time {:.6f} s", static_cast<double>(map.utime) * 1e-6));
    }
    const std::string name = fmt::format("{}.{:06}.png", map.utime / 1'000'000, map.utime % 1'000'000);
    const auto converged = [](DepthState state) { return state == DepthState::kConverged; };
    write_image(root / "depth" / name, steps_image(map, map.depth_m, kDepthImageStep_m, converged, &result.too_far));
    std::int64_t uncounted = 0;
    write_image(root / "sigma" / name, steps_image(map, map.sigma_m, kSigmaImageStep_m, has_depth, &uncounted));
    write_image(root / "state" / name, state_image(map));
    poses.push_back({static_cast<double>(map.utime) * 1e-6, map.T_world_camera});
    ++result.depth_maps;
  });
  if (!camera) throw InputError(log.string() + ": holds no depth map");
  std::sort(poses.begin(), poses.end(), [](const StampedPose& a, const StampedPose& b) { return a.time_s < b.time_s; });
  write_tum_trajectory(root / "groundtruth.txt", poses);
  AtomicFile list(root / "depth.txt");
  list.stream() << "# timestamp file; 16 bit, " << kDepthImageStep_m << " m a step, converged pixels, 0: none\n"
                << "# sigma/ of the same names: 16 bit, " << kSigmaImageStep_m << " m a step\n"
                << "# state/: green converged, orange edge, blue updating, red diverged, black none\n";
  for (const std::int64_t time : times) {
    const std::string stamp = fmt::format("{}.{:06}", time / 1'000'000, time % 1'000'000);
    list.stream() << stamp << " depth/" << stamp << ".png\n";
  }
  list.commit();
  AtomicFile yaml(root / "camera.yaml");
  yaml.stream() << fmt::format(
      "width: {}\nheight: {}\nfx: {}\nfy: {}\ncx: {}\ncy: {}\ndistortion: none\ndepth_scale_m: {}\n", camera->width,
      camera->height, camera->fx, camera->fy, camera->cx, camera->cy, kDepthImageStep_m);
  yaml.commit();
  pending.commit();
  return result;
}

}  // namespace vantage
