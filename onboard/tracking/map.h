#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <unordered_map>
#include <vector>

#include <Eigen/Geometry>

#include "onboard/tracking/depth_belief.h"
#include "onboard/tracking/image_pyramid.h"
#include "onboard/tracking/similarity.h"

namespace vantage::tracking {

using KeyFrameId = std::uint64_t;
using LandmarkId = std::uint64_t;
using Descriptor = std::array<std::uint64_t, 4>;  // 256 comparisons, a bit each

/// Where the robot says the camera was, and how well it knows.
struct PosePrior {
  Eigen::Isometry3d T_world_camera = Eigen::Isometry3d::Identity();
  double sigma_translation_m = 0.002;
  double sigma_rotation_rad = 0.0035;
};

/// A landmark as one frame saw it.
struct Feature {
  LandmarkId landmark = 0;
  Eigen::Vector2d pixel{0, 0};  ///< of level 0
  int level = 0;                ///< of the pyramid on which it was aligned: its place is known to 2^level px
  bool edgelet = false;
  Eigen::Vector2d normal{1, 0};  ///< unit, across an edgelet's edge
};

/// A landmark as one key frame saw it.
struct Observation {
  KeyFrameId key_frame = 0;
  Eigen::Vector2d pixel{0, 0};
  int level = 0;
  Eigen::Vector2d normal{1, 0};
};

/// A point of the scene. Until its depth has converged it is a seed: it hangs at its host key frame by a ray and a
/// belief. After that it is a point of the world.
struct Landmark {
  LandmarkId id = 0;
  KeyFrameId host = 0;
  Eigen::Vector2d pixel{0, 0};   ///< in the host
  Eigen::Vector3d ray{0, 0, 1};  ///< unit, in the host
  int level = 0;
  bool edgelet = false;
  Eigen::Vector2d normal{1, 0};
  DepthBelief depth;
  bool converged = false;
  Eigen::Vector3d position{0, 0, 0};      ///< world, m; of a seed: at the mean of its belief
  double sigma_m = 0;                     ///< of the distance from the host
  std::vector<Observation> observations;  ///< the host's first
  int tried = 0, found = 0;               ///< how often a frame sought it, and found it
  int missed_in_row = 0;
  std::uint64_t last_visit = 0;  ///< mark of the last search that considered it
  Descriptor descriptor{};
  bool described = false;
};

struct KeyFrame {
  KeyFrameId id = 0;
  std::uint64_t sequence = 0;  ///< of the frame that it was
  std::int64_t capture_time_ns = 0;
  std::shared_ptr<const ImagePyramid> image;
  Eigen::Isometry3d T_camera_world = Eigen::Isometry3d::Identity();
  std::vector<Feature> features;   ///< landmarks seen, converged ones
  std::vector<LandmarkId> hosted;  ///< landmarks whose host it is, seeds too
  std::optional<PosePrior> prior;
  double scale = 1;  ///< product of all changes of scale that corrections have brought it
  int map = 0;       ///< number of the piece of map: pieces that have not been joined have frames of their own
  double median_distance_m = 1;
};

/// Key frames and landmarks. Not thread-safe: Mapper's lock guards it.
class Map {
 public:
  KeyFrame& add_key_frame(KeyFrame key_frame);  // assigns the id
  Landmark& add_landmark(Landmark landmark);    // assigns the id, enters it with its host
  KeyFrame* key_frame(KeyFrameId id);
  const KeyFrame* key_frame(KeyFrameId id) const;
  Landmark* landmark(LandmarkId id);
  const Landmark* landmark(LandmarkId id) const;

  /// Adds an observation to a landmark and to its key frame. Nothing when there is one already.
  void observe(LandmarkId landmark, const Observation& observation);
  void remove_observation(LandmarkId landmark, KeyFrameId key_frame);
  void remove_landmark(LandmarkId id);
  /// Its landmarks pass to another key frame that saw them, or go.
  void remove_key_frame(KeyFrameId id);
  /// Moves a key frame with all that it hosts by a similarity of the world: its scale becomes the world's.
  void move_key_frame(KeyFrame* frame, const Similarity& S_new_old);
  /// Every observation of `from` becomes one of `into`; `from` goes.
  void merge_landmarks(LandmarkId into, LandmarkId from);
  void clear();

  /// Key frames that share landmarks with this one and how many, most first, then by id.
  std::vector<std::pair<KeyFrameId, int>> covisible(KeyFrameId id) const;

  /// Moves a seed's position to the mean of its belief, and takes its sigma from there.
  void place_seed(Landmark* seed) const;
  /// Sigma of a converged landmark: what `ray_error_rad` in each of its rays does to the distance, by the widest angle
  /// under which its observations see it.
  void judge_point(Landmark* point, double ray_error_rad) const;

  const std::map<KeyFrameId, KeyFrame>& key_frames() const { return key_frames_; }
  std::map<KeyFrameId, KeyFrame>& key_frames() { return key_frames_; }
  std::size_t landmarks() const { return landmarks_.size(); }
  std::uint64_t next_visit() { return ++visit_; }

 private:
  std::map<KeyFrameId, KeyFrame> key_frames_;
  std::unordered_map<LandmarkId, Landmark> landmarks_;
  KeyFrameId next_key_frame_ = 1;
  LandmarkId next_landmark_ = 1;
  std::uint64_t visit_ = 0;
};

}  // namespace vantage::tracking
