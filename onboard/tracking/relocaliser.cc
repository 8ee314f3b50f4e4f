#include "onboard/tracking/relocaliser.h"

#include <algorithm>
#include <set>

#include <opencv2/calib3d.hpp>

#include "onboard/tracking/corner_detector.h"
#include "onboard/tracking/descriptor.h"
#include "onboard/tracking/descriptor_matching.h"

namespace vantage::tracking {
namespace {

constexpr std::size_t kPlaces = 6;
constexpr int kLeastMatches = 12;
constexpr double kError_px = 5;
constexpr int kLookAlike = 12;        // key frames that are compared as a whole
constexpr double kAlike = 0.6;        // correlation of the small images, above which it is worth a search
constexpr double kLeastShare = 0.35;  // of what should be visible must be found

/// The place itself first, then those that share most with it.
std::vector<KeyFrameId> neighbourhood(const Map& map, KeyFrameId place) {
  std::vector<KeyFrameId> around{place};
  for (const auto& [neighbour, shared] : map.covisible(place)) {
    if (around.size() < 6) around.push_back(neighbour);
  }
  return around;
}

/// Searches the landmarks around a supposed pose; none when too few are at their places.
std::optional<Relocalised> verify(const CameraModel& camera, Map* map, const std::vector<KeyFrameId>& around,
                                  const ImagePyramid& image, Eigen::Isometry3d T, MapSearch* search,
                                  int least_inliers) {
  Relocalised found;
  found.place = around.front();
  for (int round = 0; round < 3; ++round) {  // each time from a better pose
    search->run(map, around, image, T, &found.matches, false);
    found.pose = refine_pose(camera, found.matches.measurements, std::nullopt, &T);
    if (found.pose.inliers < least_inliers / 3) return std::nullopt;
  }
  found.T_camera_world = T;
  if (found.pose.inliers < least_inliers || found.pose.inliers < kLeastShare * found.matches.visible) {
    return std::nullopt;
  }
  return found;
}

}  // namespace

std::optional<Relocalised> relocalise(const CameraModel& camera, Map* map, const PlaceIndex& places,
                                      const ImagePyramid& image, MapSearch* search, RotationAlignment* rotation,
                                      int least_inliers) {
  DetectorOptions detector;
  detector.cell_px = std::max(10, camera.width / 36);
  detector.edgelets = false;
  std::vector<Descriptor> seen;
  std::vector<Eigen::Vector2d> pixels;
  std::vector<int> levels;
  for (const Corner& corner : detect_corners(image, {}, detector)) {
    Descriptor descriptor;
    if (!describe(image.level(corner.level), to_level(corner.pixel.x(), corner.level),
                  to_level(corner.pixel.y(), corner.level), &descriptor)) {
      continue;
    }
    seen.push_back(descriptor);
    pixels.push_back(corner.pixel);
    levels.push_back(corner.level);
  }

  std::optional<Relocalised> best;
  for (const auto& [place, score] : places.query(seen, kPlaces)) {
    const std::vector<KeyFrameId> around = neighbourhood(*map, place);
    std::set<LandmarkId> ids;
    for (std::size_t i = 0; i < around.size() && i < 3; ++i) {
      const KeyFrame* frame = map->key_frame(around[i]);
      if (frame == nullptr) continue;
      for (const Feature& feature : frame->features) ids.insert(feature.landmark);
      for (const LandmarkId hosted : frame->hosted) ids.insert(hosted);
    }
    std::vector<Descriptor> known;
    std::vector<const Landmark*> landmarks;
    for (const LandmarkId id : ids) {
      const Landmark* landmark = map->landmark(id);
      if (landmark == nullptr || !landmark->converged || !landmark->described) continue;
      known.push_back(landmark->descriptor);
      landmarks.push_back(landmark);
    }
    const auto pairs = match_descriptors(seen, known);
    if (pairs.size() < kLeastMatches) continue;
    std::vector<cv::Point3d> points;
    std::vector<cv::Point2d> image_points;
    std::vector<PoseMeasurement> measurements;
    for (const auto& [i, j] : pairs) {
      const auto s = static_cast<std::size_t>(i), k = static_cast<std::size_t>(j);
      Eigen::Vector3d ray;
      if (!camera.unproject(pixels[s], &ray) || ray.z() < 0.1) continue;
      const Eigen::Vector3d& p = landmarks[k]->position;
      points.emplace_back(p.x(), p.y(), p.z());
      image_points.emplace_back(ray.x() / ray.z(), ray.y() / ray.z());
      measurements.push_back({.position = p,
                              .spread = Eigen::Vector3d::Zero(),
                              .pixel = pixels[s],
                              .sigma_px = static_cast<double>(1 << levels[s])});
    }
    if (points.size() < kLeastMatches) continue;
    cv::Mat rotation_vector, translation;
    std::vector<int> inliers;
    if (!cv::solvePnPRansac(points, image_points, cv::Mat::eye(3, 3, CV_64F), cv::noArray(), rotation_vector,
                            translation, false, 200, static_cast<float>(kError_px / camera.fx), 0.999, inliers,
                            cv::SOLVEPNP_AP3P) ||
        inliers.size() < kLeastMatches) {
      continue;
    }
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.linear() =
        rotation_exp({rotation_vector.at<double>(0), rotation_vector.at<double>(1), rotation_vector.at<double>(2)})
            .toRotationMatrix();
    T.translation() = Eigen::Vector3d(translation.at<double>(0), translation.at<double>(1), translation.at<double>(2));
    std::vector<PoseMeasurement> good;
    for (const int i : inliers) good.push_back(measurements[static_cast<std::size_t>(i)]);
    refine_pose(camera, good, std::nullopt, &T);
    std::optional<Relocalised> found = verify(camera, map, around, image, T, search, least_inliers);
    if (!found) continue;
    if (!best || found->pose.inliers > best->pose.inliers) best = std::move(found);
    if (best->pose.inliers > 2 * least_inliers) break;
  }
  if (best) return best;

  int tried = 0;
  for (auto frame = map->key_frames().rbegin(); frame != map->key_frames().rend() && tried < kLookAlike;
       ++frame, ++tried) {
    const RotationAlignment::Result turn = rotation->align(*frame->second.image, image);
    if (turn.correlation < kAlike) continue;
    Eigen::Isometry3d T = frame->second.T_camera_world;
    T = Eigen::Isometry3d(turn.R_current_reference) * T;
    if (auto found = verify(camera, map, neighbourhood(*map, frame->first), image, T, search, least_inliers)) {
      return found;
    }
  }
  return std::nullopt;
}

}  // namespace vantage::tracking
