#include "drivers/sim/recording.h"

#include <cmath>
#include <numbers>
#include <vector>

#include <fmt/core.h>
#include <opencv2/imgcodecs.hpp>

#include "calib/files/atomic_file.h"
#include "calib/files/input_error.h"
#include "drivers/sim/renderer.h"
#include "drivers/sim/sensor.h"
#include "drivers/sim/snapshot.h"

namespace vantage::sim {
namespace {

constexpr double kDepthStep_m = 1e-4;
constexpr int kBlurSamples = 8;
constexpr double kCoveredShare = 0.01;

bool fail(std::string* why, std::string reason) {
  if (why != nullptr) *why = std::move(reason);
  return false;
}

Eigen::Isometry3d pose_at(const RecordingOptions& options, double time_s) {
  Eigen::Isometry3d pose = pose_on_path(options.path, time_s);
  if (options.jump_at_s >= 0 && time_s >= options.jump_at_s) {
    pose.rotate(Eigen::AngleAxisd(options.jump_deg * std::numbers::pi / 180, Eigen::Vector3d::UnitY()));
  }
  return pose;
}

/// Mean radiance while the shutter is open, `time_s` in the middle of it.
void expose_to_world(const Renderer& renderer, const RecordingOptions& options, double time_s,
                     std::vector<float>* radiance) {
  if (options.exposure_s <= 0) {
    renderer.render(options.camera, pose_at(options, time_s), radiance);
    return;
  }
  std::vector<float> instant;
  radiance->clear();
  for (int i = 0; i < kBlurSamples; ++i) {
    const double offset = options.exposure_s * ((i + 0.5) / kBlurSamples - 0.5);
    renderer.render(options.camera, pose_at(options, time_s + offset), &instant);
    radiance->resize(instant.size(), 0.0F);
    for (std::size_t k = 0; k < instant.size(); ++k) (*radiance)[k] += instant[k] / kBlurSamples;
  }
}

double light_at(const RecordingOptions& options, double time_s) {
  constexpr double kPeriod_s = 3;
  double light = 1 + options.light_swing * std::sin(2 * std::numbers::pi * time_s / kPeriod_s);
  if (time_s >= options.covered_from_s && time_s < options.covered_to_s) light *= kCoveredShare;
  return light;
}

void write_depth(const std::filesystem::path& path, const CameraModel& camera, const std::vector<float>& depth_m) {
  cv::Mat image(camera.height, camera.width, CV_16UC1);
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const double steps =
          depth_m[static_cast<std::size_t>(y) * static_cast<std::size_t>(camera.width) + static_cast<std::size_t>(x)] /
          kDepthStep_m;
      image.at<std::uint16_t>(y, x) = steps < 65535 ? static_cast<std::uint16_t>(std::lround(steps)) : 0;
    }
  }
  if (!cv::imwrite(path.string(), image)) throw InputError(path.string() + ": can't be written");
}

void write_text(const std::filesystem::path& path, const std::string& text) {
  AtomicFile file(path);
  file.stream() << text;
  file.commit();
}

std::string camera_yaml(const CameraModel& camera) {
  return fmt::format("width: {}\nheight: {}\nfx: {}\nfy: {}\ncx: {}\ncy: {}\ndistortion: none\ndepth_scale_m: {}\n",
                     camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy, kDepthStep_m);
}

}  // namespace

bool RecordingOptions::valid(std::string* why) const {
  if (!camera.valid(why)) return false;
  if (camera.distortion != Distortion::kNone) return fail(why, "a recording's camera has no distortion");
  if (frames < 1 || frames > 1'000'000) return fail(why, "the number of frames must lie between 1 and 1,000,000");
  if (!(frames_per_s > 0 && frames_per_s <= 1000)) return fail(why, "the frame rate must lie between 0 and 1000 /s");
  if (!(noise_sigma >= 0 && noise_sigma <= 50)) return fail(why, "the noise must lie between 0 and 50 grey levels");
  if (!(exposure_s >= 0 && exposure_s * frames_per_s <= 1)) return fail(why, "the exposure must fit into a frame");
  if (!(light_swing >= 0 && light_swing < 1)) return fail(why, "the light's swing must lie between 0 and 1");
  if (truth_depth_every < 0) return fail(why, "the truth's interval can't be negative");
  if (!std::isfinite(jump_deg)) return fail(why, "the jump must be a finite angle");
  return true;
}

void write_recording(const World& world, const RecordingOptions& options, const std::filesystem::path& folder,
                     const std::function<bool(int)>& progress) {
  if (std::string why; !options.valid(&why)) throw InputError("recording: " + why);
  if (std::filesystem::exists(folder / "rgb.txt")) {
    throw InputError(folder.string() + ": holds a recording already; name another folder");
  }
  std::filesystem::create_directories(folder / "rgb");
  if (options.truth_depth_every > 0) std::filesystem::create_directories(folder / "depth");

  const Renderer renderer(world);
  const CameraModel& camera = options.camera;
  std::vector<float> radiance, depth_m;
  std::vector<std::uint8_t> grey(static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height));
  std::vector<StampedPose> truth;
  std::string images = "# timestamp file\n", depths = images;
  for (int i = 0; i < options.frames; ++i) {
    const double time_s = i / options.frames_per_s;
    const std::string name = fmt::format("{:05}.png", i);
    expose_to_world(renderer, options, time_s, &radiance);
    expose(radiance, kReferenceExposure_s * light_at(options, time_s), options.noise_sigma,
           noise_key(options.seed, static_cast<std::uint64_t>(i), 0), grey);
    write_image(folder / "rgb" / name, camera.width, camera.height, grey);
    images += fmt::format("{:.6f} rgb/{}\n", time_s, name);
    truth.push_back({time_s, pose_at(options, time_s)});
    if (options.truth_depth_every > 0 && i % options.truth_depth_every == 0) {
      renderer.depth(camera, truth.back().T_world_camera, &depth_m);
      write_depth(folder / "depth" / name, camera, depth_m);
      depths += fmt::format("{:.6f} depth/{}\n", time_s, name);
    }
    if (progress && !progress(i + 1)) break;
  }
  write_text(folder / "rgb.txt", images);
  if (options.truth_depth_every > 0) write_text(folder / "depth.txt", depths);
  write_text(folder / "camera.yaml", camera_yaml(camera));
  write_tum_trajectory(folder / "groundtruth.txt", truth);
}

}  // namespace vantage::sim
