#include "drivers/sim/stereo_camera.h"

#include <cmath>
#include <stdexcept>
#include <vector>

#include "drivers/sim/sensor.h"
#include "lcmtypes/link/depth_map.h"

namespace vantage::sim {
namespace {

bool fail(std::string* why, std::string reason) {
  if (why != nullptr) *why = std::move(reason);
  return false;
}

}  // namespace

bool StereoOptions::valid(std::string* why) const {
  if (!camera.valid(why)) return false;
  if (!(std::isfinite(baseline_m) && baseline_m > 0)) return fail(why, "the baseline must be positive (m)");
  if (!(exposure_s >= 1e-6 && exposure_s <= 1)) return fail(why, "the exposure must lie between 1e-6 and 1 s");
  if (!(noise_sigma >= 0 && noise_sigma <= 50)) return fail(why, "the noise must lie between 0 and 50 grey levels");
  return true;
}

StereoCamera::StereoCamera(std::shared_ptr<const Renderer> renderer, const StereoOptions& options)
    : renderer_(std::move(renderer)), options_(options) {
  std::string why;
  if (!options.valid(&why)) throw std::invalid_argument("StereoCamera: " + why);
}

std::size_t StereoCamera::pixels() const {
  return static_cast<std::size_t>(options_.camera.width) * static_cast<std::size_t>(options_.camera.height);
}

Eigen::Isometry3d StereoCamera::right_pose(const Eigen::Isometry3d& T_world_left) const {
  return T_world_left * Eigen::Translation3d(options_.baseline_m, 0, 0);
}

void StereoCamera::capture(const Eigen::Isometry3d& T_world_left, std::uint64_t count, std::span<std::uint8_t> left,
                           std::span<std::uint8_t> right) const {
  if (left.size() != pixels() || (!right.empty() && right.size() != pixels())) {
    throw std::invalid_argument("StereoCamera: an image buffer has not the camera's size");
  }
  if (!is_rigid(T_world_left)) throw std::invalid_argument("StereoCamera: the pose is not rigid");
  std::vector<float> radiance;
  renderer_->render(options_.camera, T_world_left, &radiance);
  expose(radiance, options_.exposure_s, options_.noise_sigma, noise_key(options_.seed, count, 0), left);
  if (right.empty()) return;
  renderer_->render(options_.camera, right_pose(T_world_left), &radiance);
  expose(radiance, options_.exposure_s, options_.noise_sigma, noise_key(options_.seed, count, 1), right);
}

}  // namespace vantage::sim
