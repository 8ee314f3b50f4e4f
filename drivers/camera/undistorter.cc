#include "drivers/camera/undistorter.h"

#include <opencv2/imgproc.hpp>

namespace vantage {

/// Where each pixel of the pinhole's image lies in the lens's.
struct Undistorter::Maps {
  cv::Mat x, y;

  Maps(const CameraModel& lens, const CameraModel& pinhole)
      : x(pinhole.height, pinhole.width, CV_32FC1), y(pinhole.height, pinhole.width, CV_32FC1) {
    for (int v = 0; v < pinhole.height; ++v) {
      for (int u = 0; u < pinhole.width; ++u) {
        Eigen::Vector2d pixel(-1, -1);
        lens.project({(u - pinhole.cx) / pinhole.fx, (v - pinhole.cy) / pinhole.fy, 1}, &pixel);
        x.at<float>(v, u) = static_cast<float>(pixel.x());
        y.at<float>(v, u) = static_cast<float>(pixel.y());
      }
    }
  }
};

Undistorter::Undistorter(const CameraModel& lens) : pinhole_(lens) {
  pinhole_.distortion = Distortion::kNone;
  pinhole_.coefficients = {};
  if (lens.distortion != Distortion::kNone) maps_ = std::make_unique<Maps>(lens, pinhole_);
}

Undistorter::~Undistorter() = default;

GreyImage Undistorter::undistort(const GreyImage& image) const {
  // cv::Mat has no const view; it is only read.
  const cv::Mat view(image.height, image.width, CV_8UC1, const_cast<std::uint8_t*>(image.pixels.get()),
                     static_cast<std::size_t>(image.stride));
  const auto straight = std::make_shared<cv::Mat>();
  if (maps_) {
    cv::remap(view, *straight, maps_->x, maps_->y, cv::INTER_LINEAR);
  } else {
    view.copyTo(*straight);
  }
  return {straight->cols, straight->rows, static_cast<std::ptrdiff_t>(straight->step),
          std::shared_ptr<const std::uint8_t>(straight, straight->data)};
}

}  // namespace vantage
