#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "calib/camera_model.h"
#include "onboard/tracking/bundle_adjustment.h"
#include "onboard/tracking/corner_detector.h"
#include "onboard/tracking/loop_closure.h"
#include "onboard/tracking/map.h"
#include "onboard/tracking/place_index.h"
#include "onboard/tracking/two_view_start.h"

namespace vantage::tracking {

struct MapperOptions {
  bool threaded = false;  ///< false: every call does its work before it returns, the same each time
  DetectorOptions detector;
  AdjustmentOptions adjustment;
  LoopOptions loop;
  int window = 8;                   ///< key frames that a local adjustment moves
  int fixed_frames = 12;            ///< others that hold it, at most
  int most_key_frames = 200;        ///< the most redundant one goes when there are more
  int seeds_per_frame = 120;        ///< at most are updated with one frame
  double converged_share = 0.08;    ///< a seed is a point when sigma(1/d) * d is below this ...
  double converged_inliers = 0.53;  ///< ... and its inlier ratio above this
  bool valid(std::string* why = nullptr) const;
};

/// A frame whose pose is known relative to a key frame, so that corrections of the map carry it along.
struct TrackedFrame {
  std::uint64_t sequence = 0;
  std::int64_t capture_time_ns = 0;
  std::shared_ptr<const ImagePyramid> image;
  KeyFrameId reference = 0;
  Eigen::Isometry3d T_camera_reference = Eigen::Isometry3d::Identity();
  double reference_scale = 1;  ///< the reference's when this was measured
  std::vector<Feature> features;
  std::optional<PosePrior> prior;
};

/// A key frame's pose after a correction.
struct CorrectedPose {
  KeyFrameId key_frame = 0;
  std::uint64_t sequence = 0;
  std::int64_t capture_time_ns = 0;
  Eigen::Isometry3d T_world_camera = Eigen::Isometry3d::Identity();
};

/// How much a mapper holds.
struct MapSize {
  std::size_t key_frames = 0;
  std::size_t landmarks = 0;     ///< points and seeds
  std::size_t observations = 0;  ///< of all landmarks
  std::size_t heirs = 0;         ///< key frames that went, and are still known relative to another
  std::size_t corrections = 0;   ///< that nobody has taken
};

/// Owner of the map: seeds, local adjustment, culling, loops; in the caller's thread or in one of its own.
///
/// With a thread, frames wait in a bounded queue: a frame that is no key frame is dropped when newer ones wait, a key
/// frame never. Everything read from the map is read under `mutex()`.
class Mapper {
 public:
  Mapper(const CameraModel& camera, const MapperOptions& options);
  ~Mapper();

  /// Guards the map and the place index. Held for one frame's search by the tracker, for gathering and writing back by
  /// the mapper; never while something is solved.
  std::mutex& mutex() { return mutex_; }
  Map& map() { return map_; }
  const PlaceIndex& places() const { return places_; }

  /// Makes a piece of map of two posed views; its scale is such that the points' median distance is `distance_m`.
  /// Gives the second view back as a tracked frame.
  TrackedFrame start(const Start& start, double distance_m);
  /// Makes a piece of map of one frame that the robot has posed; its scene is assumed about `distance_m` away.
  TrackedFrame start(const StartFrame& frame, const PosePrior& prior, double distance_m);
  /// Takes away the piece of map that was begun last.
  void undo_start();

  /// A posed frame, for the seeds.
  void observe(const TrackedFrame& frame);
  /// A posed frame that is to be a key frame. Its id, once it is in the map, is reported by `key_frame_of`.
  void add_key_frame(const TrackedFrame& frame);
  /// Waits until nothing is left to do.
  void finish();

  /// T_camera_world of a key frame, or of one that was culled, through its heir; of the last 10 000 that were. Caller
  /// holds the lock.
  std::optional<Eigen::Isometry3d> pose_of(KeyFrameId id) const;
  /// T_camera_world of a frame by its key frame: when the key frame's scale has changed since, so has the frame's
  /// distance to it.
  std::optional<Eigen::Isometry3d> pose_of(KeyFrameId reference, const Eigen::Isometry3d& T_camera_reference,
                                           double reference_scale) const;
  double scale_of(KeyFrameId id) const;
  /// Moves a whole piece of map. Caller holds the lock.
  void move_piece(int piece, const Similarity& S_new_old);
  int piece_of(KeyFrameId id) const;
  std::size_t key_frames() const {
    const std::lock_guard lock(mutex_);
    return map_.key_frames().size();
  }
  MapSize size() const;
  int pieces() const { return pieces_; }
  int loops_closed() const { return loops_closed_; }
  std::uint64_t frames_dropped() const { return dropped_; }

  /// Key frames that a loop closure has moved since the last call, each once, where it is now.
  std::vector<CorrectedPose> take_corrections();

 private:
  struct Task {
    TrackedFrame frame;
    bool key_frame = false;
  };
  static constexpr double kRayError_px = 0.5;       // of an observation's place, pixels of its level
  static constexpr std::size_t kSeedKeyFrames = 6;  // whose seeds are updated, the newest
  struct Heir {
    KeyFrameId id;
    Eigen::Isometry3d T_gone_heir;
    double gone_scale, heir_scale;  // when it went
  };

  void submit(Task task);
  void work();
  void run(const Task& task);
  KeyFrameId insert(const TrackedFrame& frame);
  void create_seeds(KeyFrameId id);
  void update_seeds(const TrackedFrame& frame);
  void look_back(KeyFrameId id);
  enum class SeedFate { kWaiting, kConverged, kHopeless };
  SeedFate update(const KeyFrame& host, const ImagePyramid& image, const Eigen::Isometry3d& T_camera_world,
                  Landmark* seed) const;
  void connect(LandmarkId id);
  void adjust_locally(KeyFrameId id);
  /// The newest key frame of the newest piece whose own points can be recognised; 0 for none.
  KeyFrameId ripe_key_frame() const;
  void close_loop(KeyFrameId id);
  void cull(KeyFrameId newest);
  /// Those that may go, in the order in which they should: with a full map all but the youngest.
  std::vector<KeyFrameId> redundant_key_frames(KeyFrameId newest) const;
  /// False when it has to stay.
  bool drop_key_frame(KeyFrameId id);
  void forget_key_frame(KeyFrameId id);
  void note_correction(const KeyFrame& frame);
  void index_place(KeyFrameId id);

  CameraModel camera_;
  MapperOptions options_;
  LoopCloser loop_closer_;

  mutable std::mutex mutex_;  // guards the members up to the next comment
  Map map_;
  PlaceIndex places_;
  std::map<KeyFrameId, Heir> heirs_;  // of key frames that went; an heir is in the map
  std::map<KeyFrameId, CorrectedPose> corrections_;
  std::size_t seed_cursor_ = 0;  // where the next frame's updates begin, of all seeds in reach
  int pieces_ = 0;
  int loops_closed_ = 0;
  KeyFrameId newest_ = 0;

  std::mutex queue_mutex_;  // guards the members below
  std::condition_variable wake_, idle_;
  std::deque<Task> queue_;
  bool stop_ = false, busy_ = false;
  std::uint64_t dropped_ = 0;

  std::thread thread_;
};

}  // namespace vantage::tracking
