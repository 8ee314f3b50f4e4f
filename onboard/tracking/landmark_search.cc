#include "onboard/tracking/landmark_search.h"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>

namespace vantage::tracking {
namespace {

constexpr double kGoodCorrelation = 0.75;
constexpr double kLikely = 0.6;  // at the nearest whole pixel
constexpr double kGoodSeedCorrelation = 0.85;
constexpr double kHostAngle = 0.866;     // cosine of 30 degrees
constexpr double kWidestAngle = 0.5;     // cosine of 60 degrees
constexpr double kAlignmentError = 0.5;  // px of the level: what one measurement is trusted to
constexpr double kStep_px = 0.7;         // along an epipolar line
constexpr int kMostSteps = 100;
constexpr double kShortSegment_px = 2;  // alignment alone bridges it
constexpr double kEdgeAcross = 0.5;     // least cosine between an edgelet's normal and its epipolar line

}  // namespace

bool warp_into(const CameraModel& camera, const ImagePyramid& reference, const Eigen::Vector2d& pixel, int level,
               const Eigen::Vector3d& ray, double distance_m, const Eigen::Isometry3d& T_current_reference,
               WarpedPatch* warped, int extra_levels) {
  // d pixel_current / d pixel_reference through the plane: point = s ray(pixel) with s such that its depth stays.
  const Eigen::Vector3d point = ray * distance_m;
  const double step = 4 * (1 << level);
  Eigen::Vector3d ray_u, ray_v;
  Eigen::Vector2d centre, at_u, at_v;
  if (!camera.unproject(pixel + Eigen::Vector2d(step, 0), &ray_u) ||
      !camera.unproject(pixel + Eigen::Vector2d(0, step), &ray_v)) {
    return false;
  }
  const double depth_u = point.dot(ray) / std::max(1e-6, ray_u.dot(ray)),
               depth_v = point.dot(ray) / std::max(1e-6, ray_v.dot(ray));
  if (!camera.project(T_current_reference * point, &centre) ||
      !camera.project(T_current_reference * (ray_u * depth_u), &at_u) ||
      !camera.project(T_current_reference * (ray_v * depth_v), &at_v)) {
    return false;
  }
  Eigen::Matrix2d A;
  A.col(0) = (at_u - centre) / step;
  A.col(1) = (at_v - centre) / step;
  const double area = A.determinant();
  if (!(area > 0.02 && area < 50)) return false;
  warped->A_current_reference = A;
  int search = level;
  double scale = area;
  while (scale > 3 && search < ImagePyramid::kLevels - 2) {
    scale /= 4;
    ++search;
  }
  while (scale < 1.0 / 3 && search > 0) {
    scale *= 4;
    --search;
  }
  search = std::min(search + extra_levels, ImagePyramid::kLevels - 2);
  warped->level = search;
  const Eigen::Matrix2d A_reference_current = A.inverse() * (1 << search) / (1 << level);
  const Eigen::Vector2d at(to_level(pixel.x(), level), to_level(pixel.y(), level));
  return warp_patch(reference.level(level), at, A_reference_current, &warped->patch);
}

bool find_landmark(const CameraModel& camera, const Map& map, const Landmark& landmark, const ImagePyramid& current,
                   const Eigen::Isometry3d& T_current_world, Feature* feature) {
  Eigen::Vector2d expected;
  const Eigen::Vector3d in_current = T_current_world * landmark.position;
  if (!camera.project(in_current, &expected) || !current.level(0).inside(expected.x(), expected.y(), kPatch)) {
    return false;
  }
  const KeyFrame* host = map.key_frame(landmark.host);
  if (host == nullptr) return false;
  // Directions from the landmark to the two cameras, both seen in the current camera.
  const auto cosine_to = [&](const KeyFrame& frame) {
    const Eigen::Vector3d centre = T_current_world * frame.T_camera_world.inverse().translation();
    return (centre - in_current).normalized().dot(-in_current.normalized());
  };
  const KeyFrame* reference = host;
  Observation view{landmark.host, landmark.pixel, landmark.level, landmark.normal};
  double cosine = cosine_to(*host);
  if (cosine < kHostAngle) {
    for (const Observation& observation : landmark.observations) {
      const KeyFrame* frame = map.key_frame(observation.key_frame);
      if (frame == nullptr) continue;
      const double other = cosine_to(*frame);
      if (other <= cosine) continue;
      cosine = other;
      reference = frame;
      view = observation;
    }
  }
  if (cosine < kWidestAngle) return false;
  const Eigen::Vector3d in_reference = reference->T_camera_world * landmark.position;
  const double distance = in_reference.norm();
  WarpedPatch warped;
  if (!warp_into(camera, *reference->image, view.pixel, view.level, in_reference / distance, distance,
                 T_current_world * reference->T_camera_world.inverse(), &warped)) {
    return false;
  }
  const Eigen::Vector2d start(to_level(expected.x(), warped.level), to_level(expected.y(), warped.level));
  Eigen::Vector2d normal;
  if (landmark.edgelet) normal = (warped.A_current_reference.inverse().transpose() * view.normal).normalized();
  const PatchAlignment found =
      align_patch(current.level(warped.level), warped.patch, start, landmark.edgelet ? &normal : nullptr);
  if (!found.converged || found.correlation < kGoodCorrelation) return false;
  feature->landmark = landmark.id;
  feature->pixel = {to_base(found.pixel.x(), warped.level), to_base(found.pixel.y(), warped.level)};
  feature->level = warped.level;
  feature->edgelet = landmark.edgelet;
  if (landmark.edgelet) feature->normal = normal;
  return true;
}

SeedUpdate find_seed(const CameraModel& camera, const KeyFrame& host, const ImagePyramid& current,
                     const Eigen::Isometry3d& T_current_world, const Landmark& seed, Feature* feature) {
  const Eigen::Isometry3d T_current_host = T_current_world * host.T_camera_world.inverse();
  const DepthBelief& depth = seed.depth;
  const double sigma = depth.sigma();
  // 1/rho as a homogeneous point: ray + rho t, which stays finite at infinity.
  const Eigen::Vector3d direction = T_current_host.linear() * seed.ray;
  const auto project = [&](double rho, Eigen::Vector2d* pixel) {
    return camera.project(direction + rho * T_current_host.translation(), pixel);
  };
  Eigen::Vector2d mean, near_end, far_end;
  if (!project(depth.mu, &mean) || !current.level(0).inside(mean.x(), mean.y(), kPatch)) return SeedUpdate::kNotVisible;
  double rho_far = std::max(depth.mu - 2 * sigma, 1e-6), rho_near = depth.mu + 2 * sigma;
  for (int i = 0; i < 10 && !project(rho_near, &near_end); ++i) rho_near = 0.5 * (rho_near + depth.mu);
  if (!project(rho_far, &far_end) || !project(rho_near, &near_end)) return SeedUpdate::kNotVisible;
  const Eigen::Vector2d segment = near_end - far_end;
  double length = segment.norm();

  WarpedPatch warped;
  int extra = 0;
  if (!warp_into(camera, *host.image, seed.pixel, seed.level, seed.ray, 1 / depth.mu, T_current_host, &warped)) {
    return SeedUpdate::kNotVisible;
  }
  while (length / (1 << warped.level) > kMostSteps * kStep_px && warped.level < ImagePyramid::kLevels - 2) {
    if (!warp_into(camera, *host.image, seed.pixel, seed.level, seed.ray, 1 / depth.mu, T_current_host, &warped,
                   ++extra)) {
      return SeedUpdate::kNotVisible;
    }
  }
  Eigen::Vector2d normal;
  if (seed.edgelet) {
    normal = (warped.A_current_reference.inverse().transpose() * seed.normal).normalized();
    if (length > 1e-6 && std::abs(segment.dot(normal)) < kEdgeAcross * length) return SeedUpdate::kNotVisible;
  }
  const ImageView image = current.level(warped.level);
  const double level_length = length / (1 << warped.level);
  Eigen::Vector2d best(to_level(mean.x(), warped.level), to_level(mean.y(), warped.level));
  if (level_length > kShortSegment_px) {
    const int steps = std::min(2 * kMostSteps, static_cast<int>(std::ceil(level_length / kStep_px)));
    const PatchCorrelation correlation(warped.patch);
    double best_correlation = -1;
    int inside = 0;
    Eigen::Vector2i last(-1, -1);
    for (int i = 0; i <= steps; ++i) {
      Eigen::Vector2d pixel;
      if (!project(rho_far + (rho_near - rho_far) * i / steps, &pixel)) continue;
      const Eigen::Vector2i at(static_cast<int>(std::lround(to_level(pixel.x(), warped.level))),
                               static_cast<int>(std::lround(to_level(pixel.y(), warped.level))));
      if (at == last || !image.inside(at.x(), at.y(), kPatch / 2.0 + 1)) continue;
      last = at;
      ++inside;
      const double here = correlation.at(image, at.x(), at.y());
      if (here > best_correlation) {
        best_correlation = here;
        best = at.cast<double>();
      }
    }
    if (inside == 0) return SeedUpdate::kNotVisible;
    if (best_correlation < kLikely) return SeedUpdate::kNoMatch;
  }
  const PatchAlignment found = align_patch(image, warped.patch, best, seed.edgelet ? &normal : nullptr);
  const double moved = (found.pixel - best).norm();
  if (!found.converged || found.correlation < kGoodSeedCorrelation || moved > 3) return SeedUpdate::kNoMatch;
  feature->landmark = seed.id;
  feature->pixel = {to_base(found.pixel.x(), warped.level), to_base(found.pixel.y(), warped.level)};
  feature->level = warped.level;
  feature->edgelet = seed.edgelet;
  if (seed.edgelet) feature->normal = normal;
  return SeedUpdate::kUpdated;
}

SeedUpdate update_seed(const CameraModel& camera, const KeyFrame& host, const ImagePyramid& current,
                       const Eigen::Isometry3d& T_current_world, Landmark* seed) {
  DepthBelief& depth = seed->depth;
  Feature feature;
  const SeedUpdate found = find_seed(camera, host, current, T_current_world, *seed, &feature);
  if (found == SeedUpdate::kNoMatch) depth.no_match();
  if (found != SeedUpdate::kUpdated) return found;
  const Eigen::Isometry3d T_current_host = T_current_world * host.T_camera_world.inverse();
  const Eigen::Vector3d direction = T_current_host.linear() * seed->ray;
  Eigen::Vector3d ray;
  if (!camera.unproject(feature.pixel, &ray)) return SeedUpdate::kNotVisible;
  // distance * direction + t = other * ray, in the least squares sense.
  Eigen::Matrix<double, 3, 2> A;
  A << direction, -ray;
  const Eigen::Matrix2d normal_matrix = A.transpose() * A;
  if (normal_matrix.determinant() < 1e-8) return SeedUpdate::kNotVisible;
  const Eigen::Vector2d distances = normal_matrix.inverse() * (A.transpose() * -T_current_host.translation());
  const double distance = distances[0];
  if (!(distance > 0) || !(distances[1] > 0)) {
    depth.no_match();
    return SeedUpdate::kNoMatch;
  }
  // Law of sines: the same triangle with the current camera's angle off by a pixel of the level.
  const Eigen::Vector3d t = T_current_host.inverse().translation();  // current camera in the host
  const double baseline = t.norm();
  const double error_rad = kAlignmentError * (1 << feature.level) / camera.fx;
  const double alpha = std::acos(std::clamp(seed->ray.dot(t) / baseline, -1.0, 1.0));
  const Eigen::Vector3d to_point = seed->ray * distance - t;
  const double beta = std::acos(std::clamp(to_point.dot(-t) / (to_point.norm() * baseline), -1.0, 1.0)) + error_rad;
  const double gamma = M_PI - alpha - beta;
  const double far = gamma > 1e-6 ? baseline * std::sin(beta) / std::sin(gamma) : 1e6;
  const double tau = std::max(far - distance, 1e-9);
  const double tau_inverse = 0.5 * (1 / std::max(distance - tau, 0.2 * distance) - 1 / (distance + tau));
  depth.update(1 / distance, tau_inverse * tau_inverse);
  if (!(depth.mu > 1e-6) || !std::isfinite(depth.sigma2)) depth.b += 1000;
  return SeedUpdate::kUpdated;
}

}  // namespace vantage::tracking
