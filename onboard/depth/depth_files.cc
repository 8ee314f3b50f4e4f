#include "onboard/depth/depth_files.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "calib/files/input_error.h"
#include "calib/files/ply.h"

namespace vantage {
namespace {

/// Blue, green, red of each PixelState.
const std::array<cv::Vec3b, kPixelStates> kStateColours = {
    {{255, 160, 0}, {0, 200, 0}, {0, 0, 255}, {90, 90, 90}, {255, 0, 255}, {0, 200, 255}, {0, 0, 0}}};

/// From blue (0) over green to red (1).
cv::Vec3b ramp(double share) {
  const double s = std::clamp(share, 0.0, 1.0);
  const auto channel = [s](double centre) {
    return static_cast<std::uint8_t>(255 * std::clamp(1.5 - std::abs(4 * s - centre), 0.0, 1.0));
  };
  return {channel(1), channel(2), channel(3)};
}

void write_image(const std::filesystem::path& path, const cv::Mat& image) {
  bool written = false;
  try {
    written = cv::imwrite(path.string(), image);
  } catch (const cv::Exception&) {
    written = false;
  }
  if (!written) throw InputError(path.string() + ": can't be written");
}

std::size_t pixel(const DepthMap& map, int x, int y) {
  return static_cast<std::size_t>(y) * static_cast<std::size_t>(map.camera.width) + static_cast<std::size_t>(x);
}

}  // namespace

void write_depth_png(const std::filesystem::path& path, const DepthMap& map, double unit_m) {
  cv::Mat image(map.camera.height, map.camera.width, CV_16UC1, cv::Scalar(0));
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      const std::size_t i = pixel(map, x, y);
      const double steps = std::round(map.depth_m[i] / unit_m);
      if (map.state[i] == DepthState::kConverged && steps < 65535) {
        image.at<std::uint16_t>(y, x) = static_cast<std::uint16_t>(steps);
      }
    }
  }
  write_image(path, image);
}

void write_depth_ply(const std::filesystem::path& path, const DepthMap& map) {
  const CameraModel& camera = map.camera;
  PlyModel cloud;
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const std::size_t i = pixel(map, x, y);
      if (map.state[i] != DepthState::kConverged) continue;
      const Eigen::Vector3d ray((x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy, 1);
      cloud.points.push_back((map.T_world_camera * (map.depth_m[i] * ray)).cast<float>());
    }
  }
  write_ply(path, cloud);
}

void write_depth_picture(const std::filesystem::path& path, const GreyImage& key_image, const DepthMap& map,
                         std::span<const PixelState> states) {
  constexpr double kReddestSigma = 0.05;
  const int w = map.camera.width, h = map.camera.height;
  double nearest = 0, farthest = 1e30;  // inverse depths
  for (std::size_t i = 0; i < map.state.size(); ++i) {
    if (map.state[i] != DepthState::kConverged) continue;
    nearest = std::max(nearest, 1.0 / map.depth_m[i]);
    farthest = std::min(farthest, 1.0 / map.depth_m[i]);
  }
  cv::Mat picture(2 * h, 2 * w, CV_8UC3, cv::Scalar(0, 0, 0));
  for (int y = 0; y < h; ++y) {
    for (int x = 0; x < w; ++x) {
      const std::size_t i = pixel(map, x, y);
      const std::uint8_t grey = key_image.pixels.get()[y * key_image.stride + x];
      picture.at<cv::Vec3b>(y, x) = {grey, grey, grey};
      picture.at<cv::Vec3b>(y + h, x + w) = kStateColours[static_cast<std::size_t>(states[i])];
      if (map.state[i] != DepthState::kConverged) continue;
      const double range = std::max(nearest - farthest, 1e-9);
      picture.at<cv::Vec3b>(y, x + w) = ramp((1.0 / map.depth_m[i] - farthest) / range);
      picture.at<cv::Vec3b>(y + h, x) = ramp(map.sigma_m[i] / map.depth_m[i] / kReddestSigma);
    }
  }
  write_image(path, picture);
}

}  // namespace vantage
