#include "drivers/camera/stereo_depth.h"

#include <cmath>
#include <stdexcept>

#include <opencv2/calib3d.hpp>

#include "lcmtypes/link/depth_edges.h"

namespace vantage {
namespace {

constexpr int kDisparityScale = cv::StereoMatcher::DISP_SCALE;  // of OpenCV's fixed-point disparities
constexpr double kSteepestSlope = 0.5;                          // px of disparity per px: 79 degrees at 0.5 m
constexpr int kLeftRightTolerance = 1;                          // px between the two directions' matches
constexpr int kUniquenessPercent = 10;                          // the best match must win by this
constexpr int kSpeckleArea = 100, kSpeckleRange = 2;            // smaller islands are removed (px, px)

cv::Mat view_of(const GreyImage& image) {
  // cv::Mat has no const view; the matcher only reads.
  return cv::Mat(image.height, image.width, CV_8UC1, const_cast<std::uint8_t*>(image.pixels.get()),
                 static_cast<std::size_t>(image.stride));
}

}  // namespace

bool StereoDepthOptions::valid(std::string* why) const {
  const auto fail = [why](const char* reason) {
    if (why != nullptr) *why = reason;
    return false;
  };
  if (disparities <= 0 || disparities % 16 != 0) return fail("disparities must be a positive multiple of 16");
  if (window < 1 || window % 2 == 0) return fail("window must be odd and positive");
  if (!(sigma_px > 0)) return fail("sigma_px must be positive");
  if (!(max_depth_m > 0)) return fail("max_depth_m must be positive");
  if (!(edge_jump_px > 0) || edge_radius_px < 0) return fail("edge_jump_px and edge_radius_px must be positive");
  return true;
}

struct StereoDepth::Impl {
  CameraModel camera;
  double baseline_m;
  StereoDepthOptions options;
  cv::Ptr<cv::StereoSGBM> matcher;
  cv::Mat disparity;  // 16-bit, in 1/16 px; <= 0: no match
};

StereoDepth::StereoDepth(const CameraModel& camera, double baseline_m, const StereoDepthOptions& options)
    : impl_(std::make_unique<Impl>(Impl{camera, baseline_m, options, {}, {}})) {
  std::string why;
  if (!options.valid(&why) || !camera.valid(&why)) throw std::invalid_argument("StereoDepth: " + why);
  if (camera.distortion != Distortion::kNone) throw std::invalid_argument("StereoDepth: the pair must be rectified");
  if (!(baseline_m > 0)) throw std::invalid_argument("StereoDepth: the baseline must be positive");
  const int area = options.window * options.window;
  impl_->matcher =
      cv::StereoSGBM::create(0, options.disparities, options.window, 8 * area, 32 * area, kLeftRightTolerance, 0,
                             kUniquenessPercent, kSpeckleArea, kSpeckleRange, cv::StereoSGBM::MODE_SGBM_3WAY);
}

StereoDepth::~StereoDepth() = default;

bool StereoDepth::compute(const Frame& frame, DepthMap* map, std::string* why) {
  const CameraModel& camera = impl_->camera;
  for (const GreyImage* image : {&frame.image, &frame.right_image}) {
    if (image->empty()) return *why = "the frame lacks one of its two images", false;
    if (image->width != camera.width || image->height != camera.height) {
      *why = "an image is " + std::to_string(image->width) + " x " + std::to_string(image->height) +
             " pixels, the rig's camera " + std::to_string(camera.width) + " x " + std::to_string(camera.height);
      return false;
    }
  }
  if (!frame.T_world_camera || !is_rigid(*frame.T_world_camera)) return *why = "the frame's pose is not known", false;

  cv::Mat& disparity = impl_->disparity;
  impl_->matcher->compute(view_of(frame.image), view_of(frame.right_image), disparity);
  map->utime = frame.capture_time_ns / 1000;
  map->camera = camera;
  map->T_world_camera = *frame.T_world_camera;
  const std::size_t pixels = disparity.total();
  map->depth_m.assign(pixels, 0);
  map->sigma_m.assign(pixels, 0);
  map->state.assign(pixels, DepthState::kInvalid);
  const double focal_baseline = camera.fx * impl_->baseline_m;
  for (int v = 0; v < camera.height; ++v) {
    const auto* row = disparity.ptr<std::int16_t>(v);
    for (int u = 0; u < camera.width; ++u) {
      if (row[u] <= 0) continue;
      const double depth = focal_baseline * kDisparityScale / row[u];
      if (depth > impl_->options.max_depth_m) continue;
      const std::size_t i =
          static_cast<std::size_t>(v) * static_cast<std::size_t>(camera.width) + static_cast<std::size_t>(u);
      map->depth_m[i] = static_cast<float>(depth);
      map->sigma_m[i] = static_cast<float>(depth * depth * impl_->options.sigma_px / focal_baseline);
      map->state[i] = DepthState::kConverged;
    }
  }
  mark_depth_edges(map, {.jump_per_m = impl_->options.edge_jump_px / focal_baseline,
                         .slope_per_m = kSteepestSlope / focal_baseline,
                         .radius_px = impl_->options.edge_radius_px});
  return true;
}

}  // namespace vantage
