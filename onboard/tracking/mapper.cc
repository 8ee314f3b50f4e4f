#include "onboard/tracking/mapper.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <stdexcept>

#include "onboard/tracking/descriptor.h"
#include "onboard/tracking/landmark_search.h"
#include "onboard/tracking/pose_graph.h"
#include "onboard/tracking/pose_refinement.h"

namespace vantage::tracking {
namespace {

constexpr std::size_t kMostFrames = 4;      // that wait for their seeds' update
constexpr std::size_t kSeedKeyFrames = 6;   // whose seeds are updated, the newest
constexpr std::size_t kLookBack = 5;        // key frames in which a new seed is sought at once
constexpr std::size_t kConnections = 6;     // key frames in which a new point is sought at once
constexpr double kRayError_px = 0.5;        // of an observation's place, pixels of its level
constexpr double kHopelessInliers = 0.25;   // a seed below this inlier ratio goes
constexpr int kMissedInRow = 20;            // a point that is visible and not found so often goes
constexpr double kRedundantShare = 0.9;     // of a key frame's points are seen by ...
constexpr std::size_t kRedundantViews = 4;  // ... so many others: it goes
constexpr std::size_t kRipe = 3;            // younger key frames, after which one's own seeds are points
constexpr std::size_t kYoungKeyFrames = 8;  // are never redundant

double median_of(std::vector<double>* values) {
  const auto middle = values->begin() + static_cast<std::ptrdiff_t>(values->size() / 2);
  std::nth_element(values->begin(), middle, values->end());
  return *middle;
}

}  // namespace

bool MapperOptions::valid(std::string* why) const {
  const auto fail = [why](const char* reason) {
    if (why != nullptr) *why = reason;
    return false;
  };
  if (!detector.valid(why) || !adjustment.valid(why) || !loop.valid(why)) return false;
  if (window < 2) return fail("window must be at least 2");
  if (fixed_frames < 0) return fail("fixed_frames must not be negative");
  if (most_key_frames < 10) return fail("most_key_frames must be at least 10");
  if (seeds_per_frame < 1) return fail("seeds_per_frame must be positive");
  if (!(converged_share > 0)) return fail("converged_share must be positive");
  if (!(converged_inliers > 0 && converged_inliers < 1)) return fail("converged_inliers must lie in (0, 1)");
  return true;
}

Mapper::Mapper(const CameraModel& camera, const MapperOptions& options)
    : camera_(camera), options_(options), loop_closer_(camera, options.loop) {
  std::string why;
  if (!options.valid(&why)) throw std::invalid_argument("Mapper: " + why);
  if (options.threaded) thread_ = std::thread([this] { work(); });
}

Mapper::~Mapper() {
  if (!thread_.joinable()) return;
  {
    const std::lock_guard lock(queue_mutex_);
    stop_ = true;
  }
  wake_.notify_all();
  thread_.join();
}

TrackedFrame Mapper::start(const Start& start, double distance_m) {
  std::vector<double> distances;
  for (const StartPoint& point : start.points) distances.push_back(point.position.norm());
  const double scale = distance_m / median_of(&distances);
  TrackedFrame last;
  KeyFrameId last_id = 0;
  {
    const std::lock_guard lock(mutex_);
    ++pieces_;
    KeyFrame first;
    first.sequence = start.first.sequence;
    first.capture_time_ns = start.first.capture_time_ns;
    first.image = start.first.image;
    first.map = pieces_;
    first.median_distance_m = distance_m;
    const KeyFrameId first_id = map_.add_key_frame(first).id;
    KeyFrame second = first;
    second.sequence = start.last.sequence;
    second.capture_time_ns = start.last.capture_time_ns;
    second.image = start.last.image;
    second.T_camera_world = start.T_last_first;
    second.T_camera_world.translation() *= scale;
    last_id = map_.add_key_frame(second).id;
    for (const StartPoint& point : start.points) {
      Landmark landmark;
      landmark.host = first_id;
      landmark.pixel = point.corner.pixel;
      landmark.level = point.corner.level;
      landmark.ray = point.position.normalized();
      landmark.position = scale * point.position;
      landmark.converged = true;
      const Descriptor none{};
      landmark.descriptor = none;
      landmark.described =
          describe(start.first.image->level(landmark.level), to_level(landmark.pixel.x(), landmark.level),
                   to_level(landmark.pixel.y(), landmark.level), &landmark.descriptor);
      const LandmarkId id = map_.add_landmark(landmark).id;
      map_.observe(id, {first_id, point.corner.pixel, point.corner.level, {1, 0}});
      map_.observe(id, {last_id, point.pixel, point.corner.level, {1, 0}});
      map_.judge_point(map_.landmark(id), kRayError_px / camera_.fx);
      last.features.push_back({id, point.pixel, point.corner.level, false, {1, 0}});
    }
    newest_ = last_id;
  }
  create_seeds(last_id);
  index_place(last_id);
  look_back(last_id);
  last.sequence = start.last.sequence;
  last.capture_time_ns = start.last.capture_time_ns;
  last.image = start.last.image;
  last.reference = last_id;
  return last;
}

TrackedFrame Mapper::start(const StartFrame& frame, const PosePrior& prior, double distance_m) {
  TrackedFrame tracked;
  tracked.sequence = frame.sequence;
  tracked.capture_time_ns = frame.capture_time_ns;
  tracked.image = frame.image;
  tracked.prior = prior;
  {
    const std::lock_guard lock(mutex_);
    ++pieces_;
    KeyFrame first;
    first.sequence = frame.sequence;
    first.capture_time_ns = frame.capture_time_ns;
    first.image = frame.image;
    first.map = pieces_;
    first.prior = prior;
    first.T_camera_world = prior.T_world_camera.inverse();
    first.median_distance_m = distance_m;
    tracked.reference = newest_ = map_.add_key_frame(first).id;
  }
  create_seeds(tracked.reference);
  index_place(tracked.reference);
  return tracked;
}

void Mapper::undo_start() {
  finish();
  const std::lock_guard lock(mutex_);
  std::vector<KeyFrameId> gone;
  for (const auto& [id, frame] : map_.key_frames()) {
    if (frame.map == pieces_) gone.push_back(id);
  }
  for (const KeyFrameId id : gone) {
    for (const LandmarkId landmark : std::vector<LandmarkId>(map_.key_frame(id)->hosted))
      map_.remove_landmark(landmark);
  }
  for (const KeyFrameId id : gone) {
    map_.remove_key_frame(id);
    places_.remove(id);
  }
}

void Mapper::observe(const TrackedFrame& frame) { submit({frame, false}); }
void Mapper::add_key_frame(const TrackedFrame& frame) { submit({frame, true}); }

void Mapper::submit(Task task) {
  if (!options_.threaded) {
    run(task);
    return;
  }
  {
    const std::lock_guard lock(queue_mutex_);
    if (queue_.size() >= kMostFrames) {
      const auto oldest = std::find_if(queue_.begin(), queue_.end(), [](const Task& t) { return !t.key_frame; });
      if (oldest != queue_.end()) {
        queue_.erase(oldest);
        ++dropped_;
      }
    }
    queue_.push_back(std::move(task));
  }
  wake_.notify_one();
}

void Mapper::work() {
  std::unique_lock lock(queue_mutex_);
  while (true) {
    wake_.wait(lock, [this] { return stop_ || !queue_.empty(); });
    if (stop_) return;
    const Task task = std::move(queue_.front());
    queue_.pop_front();
    busy_ = true;
    lock.unlock();
    run(task);
    lock.lock();
    busy_ = false;
    if (queue_.empty()) idle_.notify_all();
  }
}

void Mapper::finish() {
  if (!options_.threaded) return;
  std::unique_lock lock(queue_mutex_);
  idle_.wait(lock, [this] { return queue_.empty() && !busy_; });
}

void Mapper::run(const Task& task) {
  if (!task.key_frame) {
    update_seeds(task.frame);
    return;
  }
  update_seeds(task.frame);
  const KeyFrameId id = insert(task.frame);
  if (id == 0) return;
  create_seeds(id);
  index_place(id);
  look_back(id);
  adjust_locally(id);
  cull(id);
  if (!options_.loop.enabled) return;
  if (const KeyFrameId ripe = ripe_key_frame(); ripe != 0) close_loop(ripe);
}

KeyFrameId Mapper::insert(const TrackedFrame& frame) {
  const std::lock_guard lock(mutex_);
  const auto T = pose_of(frame.reference, frame.T_camera_reference, frame.reference_scale);
  if (!T) return 0;
  KeyFrame added;
  added.sequence = frame.sequence;
  added.capture_time_ns = frame.capture_time_ns;
  added.image = frame.image;
  added.T_camera_world = renormalized(*T);
  added.prior = frame.prior;
  added.map = piece_of(frame.reference);
  std::vector<double> distances;
  for (const Feature& feature : frame.features) {
    if (const Landmark* seen = map_.landmark(feature.landmark)) {
      distances.push_back((added.T_camera_world * seen->position).norm());
    }
  }
  if (distances.empty()) {
    const KeyFrame* before = map_.key_frame(frame.reference);
    added.median_distance_m = before ? before->median_distance_m : 1;
  } else {
    added.median_distance_m = median_of(&distances);
  }
  const KeyFrameId id = map_.add_key_frame(added).id;
  for (const Feature& feature : frame.features) {
    Landmark* seen = map_.landmark(feature.landmark);
    if (seen == nullptr || !seen->converged) continue;
    map_.observe(feature.landmark, {id, feature.pixel, feature.level, feature.normal});
  }
  newest_ = id;
  return id;
}

void Mapper::create_seeds(KeyFrameId id) {
  std::shared_ptr<const ImagePyramid> image;
  std::vector<Eigen::Vector2d> occupied;
  struct Known {
    Eigen::Vector2d pixel;
    double inverse_distance;
  };
  std::vector<Known> known;
  double nearest = 1e9, median_distance = 1;
  {
    const std::lock_guard lock(mutex_);
    const KeyFrame& frame = *map_.key_frame(id);
    image = frame.image;
    median_distance = frame.median_distance_m;
    for (const Feature& feature : frame.features) {
      occupied.push_back(feature.pixel);
      if (const Landmark* seen = map_.landmark(feature.landmark)) {
        const double distance = (frame.T_camera_world * seen->position).norm();
        known.push_back({feature.pixel, 1 / distance});
        nearest = std::min(nearest, distance);
      }
    }
  }
  nearest = std::clamp(nearest, 0.2 * median_distance, 0.6 * median_distance);
  const std::vector<Corner> corners = detect_corners(*image, occupied, options_.detector);
  std::vector<Landmark> seeds;
  seeds.reserve(corners.size());
  for (const Corner& corner : corners) {
    Landmark seed;
    if (!camera_.unproject(corner.pixel, &seed.ray)) continue;
    seed.host = id;
    seed.pixel = corner.pixel;
    seed.level = corner.level;
    seed.edgelet = corner.edgelet;
    seed.normal = corner.normal;
    // The points around say where to begin; the width of the belief stays, for a neighbour may be on another surface.
    double sum = 1e-3 / median_distance, weights = 1e-3;
    for (const Known& k : known) {
      const double square = (k.pixel - corner.pixel).squaredNorm() / (60.0 * 60.0);
      if (square > 9) continue;
      const double weight = std::exp(-square);
      sum += weight * k.inverse_distance;
      weights += weight;
    }
    seed.depth = DepthBelief::start(weights / sum, nearest);
    if (!seed.edgelet) {
      seed.described = describe(image->level(seed.level), to_level(seed.pixel.x(), seed.level),
                                to_level(seed.pixel.y(), seed.level), &seed.descriptor);
    }
    seeds.push_back(seed);
  }
  const std::lock_guard lock(mutex_);
  for (Landmark& seed : seeds) {
    map_.place_seed(&seed);
    map_.add_landmark(seed);
  }
}

void Mapper::update_seeds(const TrackedFrame& frame) {
  const std::lock_guard lock(mutex_);
  const auto T = pose_of(frame.reference, frame.T_camera_reference, frame.reference_scale);
  if (!T) return;
  const int piece = piece_of(frame.reference);
  std::vector<std::pair<const KeyFrame*, Landmark*>> seeds;
  std::size_t hosts = 0;
  for (auto host = map_.key_frames().rbegin(); host != map_.key_frames().rend() && hosts < kSeedKeyFrames; ++host) {
    if (host->second.map != piece) continue;
    ++hosts;
    for (const LandmarkId id : host->second.hosted) {
      Landmark* seed = map_.landmark(id);
      if (seed != nullptr && !seed->converged) seeds.emplace_back(&host->second, seed);
    }
  }
  const std::size_t turn = std::min(seeds.size(), static_cast<std::size_t>(options_.seeds_per_frame));
  std::vector<LandmarkId> hopeless, converged;
  for (std::size_t i = 0; i < turn; ++i) {
    const auto& [host, seed] = seeds[(seed_cursor_ + i) % seeds.size()];
    const SeedFate fate = update(*host, *frame.image, *T, seed);
    if (fate == SeedFate::kHopeless) hopeless.push_back(seed->id);
    if (fate == SeedFate::kConverged) converged.push_back(seed->id);
  }
  seed_cursor_ = turn < seeds.size() ? (seed_cursor_ + turn) % seeds.size() : 0;
  for (const LandmarkId id : hopeless) map_.remove_landmark(id);
  for (const LandmarkId id : converged) connect(id);
}

Mapper::SeedFate Mapper::update(const KeyFrame& host, const ImagePyramid& image,
                                const Eigen::Isometry3d& T_camera_world, Landmark* seed) const {
  if (update_seed(camera_, host, image, T_camera_world, seed) == SeedUpdate::kNotVisible) return SeedFate::kWaiting;
  if (seed->depth.inlier_ratio() < kHopelessInliers) return SeedFate::kHopeless;
  map_.place_seed(seed);
  return seed->depth.sigma() < options_.converged_share * seed->depth.mu &&
                 seed->depth.inlier_ratio() > options_.converged_inliers
             ? SeedFate::kConverged
             : SeedFate::kWaiting;
}

void Mapper::look_back(KeyFrameId id) {
  const std::lock_guard lock(mutex_);
  const KeyFrame& host = *map_.key_frame(id);
  std::vector<const KeyFrame*> earlier;
  for (auto other = map_.key_frames().rbegin(); other != map_.key_frames().rend() && earlier.size() < kLookBack;
       ++other) {
    if (other->first != id && other->second.map == host.map) earlier.push_back(&other->second);
  }
  std::vector<LandmarkId> hopeless, converged;
  for (const LandmarkId hosted : host.hosted) {
    Landmark* seed = map_.landmark(hosted);
    if (seed == nullptr || seed->converged) continue;
    SeedFate fate = SeedFate::kWaiting;
    for (const KeyFrame* other : earlier) {
      fate = update(host, *other->image, other->T_camera_world, seed);
      if (fate != SeedFate::kWaiting) break;
    }
    if (fate == SeedFate::kHopeless) hopeless.push_back(hosted);
    if (fate == SeedFate::kConverged) converged.push_back(hosted);
  }
  for (const LandmarkId seed : hopeless) map_.remove_landmark(seed);
  for (const LandmarkId seed : converged) connect(seed);
}

void Mapper::connect(LandmarkId id) {
  Landmark* landmark = map_.landmark(id);
  landmark->converged = true;
  const KeyFrameId host = landmark->host;
  map_.observe(id, {host, landmark->pixel, landmark->level, landmark->normal});
  const int piece = map_.key_frame(host)->map;
  std::size_t sought = 0;
  for (auto other = map_.key_frames().rbegin(); other != map_.key_frames().rend() && sought < kConnections; ++other) {
    if (other->first == host || other->second.map != piece) continue;
    ++sought;
    Feature feature;
    if (find_landmark(camera_, map_, *landmark, *other->second.image, other->second.T_camera_world, &feature)) {
      map_.observe(id, {other->first, feature.pixel, feature.level, feature.normal});
    }
  }
  refine_point(camera_, map_, landmark);
  map_.judge_point(landmark, kRayError_px / camera_.fx);
}

void Mapper::adjust_locally(KeyFrameId id) {
  AdjustmentProblem problem;
  std::vector<KeyFrameId> pose_ids;
  std::vector<LandmarkId> point_ids;
  std::vector<std::pair<KeyFrameId, LandmarkId>> observation_ids;
  std::size_t free = 0;
  {
    const std::lock_guard lock(mutex_);
    const KeyFrame* centre = map_.key_frame(id);
    if (centre == nullptr) return;
    pose_ids.push_back(id);
    const auto covisible = map_.covisible(id);
    for (const auto& [other, shared] : covisible) {
      if (static_cast<int>(pose_ids.size()) < options_.window && shared >= 8) pose_ids.push_back(other);
    }
    free = pose_ids.size();
    std::set<LandmarkId> points;
    std::map<KeyFrameId, int> outside;
    for (const KeyFrameId pose : pose_ids) {
      for (const Feature& feature : map_.key_frame(pose)->features) {
        const Landmark* landmark = map_.landmark(feature.landmark);
        if (landmark == nullptr || !landmark->converged || landmark->observations.size() < 2) continue;
        if (!points.insert(feature.landmark).second) continue;
        for (const Observation& o : landmark->observations) {
          if (std::find(pose_ids.begin(), pose_ids.end(), o.key_frame) == pose_ids.end()) ++outside[o.key_frame];
        }
      }
    }
    std::vector<std::pair<KeyFrameId, int>> holding(outside.begin(), outside.end());
    std::stable_sort(holding.begin(), holding.end(), [](const auto& a, const auto& b) { return a.second > b.second; });
    for (const auto& [other, shared] : holding) {
      if (pose_ids.size() < free + static_cast<std::size_t>(options_.fixed_frames)) pose_ids.push_back(other);
    }
    std::map<KeyFrameId, int> pose_index;
    bool any_prior = false;
    for (std::size_t i = 0; i < pose_ids.size(); ++i) {
      const KeyFrame& frame = *map_.key_frame(pose_ids[i]);
      pose_index[pose_ids[i]] = static_cast<int>(i);
      problem.poses.push_back({frame.T_camera_world, i >= free, frame.prior});
      any_prior |= frame.prior.has_value();
    }
    for (const LandmarkId point : points) {
      const Landmark& landmark = *map_.landmark(point);
      const int index = static_cast<int>(problem.points.size());
      int views = 0;
      for (const Observation& o : landmark.observations) views += static_cast<int>(pose_index.count(o.key_frame));
      if (views < (landmark.edgelet ? 3 : 2)) continue;  // two views of an edge leave a point free along it
      problem.points.push_back(landmark.position);
      point_ids.push_back(point);
      for (const Observation& o : landmark.observations) {
        const auto pose = pose_index.find(o.key_frame);
        if (pose == pose_index.end()) continue;
        problem.observations.push_back({.pose = pose->second,
                                        .point = index,
                                        .pixel = o.pixel,
                                        .sigma_px = static_cast<double>(1 << o.level),
                                        .edgelet = landmark.edgelet,
                                        .normal = o.normal});
        observation_ids.emplace_back(o.key_frame, point);
      }
    }
    // Without metric information and with too little that holds it, the two oldest poses hold frame and scale.
    if (!any_prior && pose_ids.size() - free < 2) {
      std::vector<std::size_t> by_age(free);
      for (std::size_t i = 0; i < free; ++i) by_age[i] = i;
      std::sort(by_age.begin(), by_age.end(), [&](std::size_t a, std::size_t b) { return pose_ids[a] < pose_ids[b]; });
      problem.poses[by_age[0]].fixed = true;
      if (free > 1 && pose_ids.size() == free) {
        problem.kept_distance = {static_cast<int>(by_age[0]), static_cast<int>(by_age[1])};
      }
    }
  }
  if (problem.points.size() < 10 || pose_ids.size() < 2) return;
  const std::vector<AdjustedPose> before = problem.poses;
  if (!adjust(camera_, &problem, options_.adjustment).usable) return;

  const std::lock_guard lock(mutex_);
  std::map<KeyFrameId, Eigen::Isometry3d> moved;  // T_new_world^-1 T_old_world: how hosted points move
  for (std::size_t i = 0; i < free; ++i) {
    KeyFrame* frame = map_.key_frame(pose_ids[i]);
    if (frame == nullptr || before[i].fixed) continue;
    moved[pose_ids[i]] = problem.poses[i].T_camera_world.inverse() * frame->T_camera_world;
    frame->T_camera_world = problem.poses[i].T_camera_world;
  }
  std::set<LandmarkId> adjusted;
  for (std::size_t i = 0; i < point_ids.size(); ++i) {
    if (Landmark* landmark = map_.landmark(point_ids[i])) {
      landmark->position = problem.points[i];
      map_.judge_point(landmark, kRayError_px / camera_.fx);
    }
    adjusted.insert(point_ids[i]);
  }
  for (std::size_t i = 0; i < problem.observations.size(); ++i) {
    if (!problem.observations[i].inlier) map_.remove_observation(observation_ids[i].second, observation_ids[i].first);
  }
  for (const LandmarkId point : point_ids) {
    const Landmark* landmark = map_.landmark(point);
    if (landmark != nullptr && landmark->observations.size() < 2) map_.remove_landmark(point);
  }
  for (const auto& [host, motion] : moved) {
    for (const LandmarkId hosted : map_.key_frame(host)->hosted) {
      Landmark* landmark = map_.landmark(hosted);
      if (landmark != nullptr && adjusted.count(hosted) == 0) landmark->position = motion * landmark->position;
    }
  }
}

void Mapper::cull(KeyFrameId newest) {
  const std::lock_guard lock(mutex_);
  const KeyFrame* centre = map_.key_frame(newest);
  if (centre == nullptr) return;
  // Points that are not found where they should be, and seeds that nobody will see again.
  std::vector<LandmarkId> gone;
  std::size_t age = 0;
  for (auto frame = map_.key_frames().rbegin(); frame != map_.key_frames().rend() && age < 40; ++frame, ++age) {
    for (const LandmarkId id : frame->second.hosted) {
      const Landmark* landmark = map_.landmark(id);
      if (landmark == nullptr) continue;
      const bool missing =
          landmark->converged && landmark->missed_in_row > kMissedInRow && 4 * landmark->found < landmark->tried;
      const bool forgotten = !landmark->converged && age > 2 * kSeedKeyFrames;
      if (missing || forgotten) gone.push_back(id);
    }
  }
  for (const LandmarkId id : gone) map_.remove_landmark(id);
  // Key frames that say nothing new.
  std::vector<KeyFrameId> redundant;
  const bool full = map_.key_frames().size() > static_cast<std::size_t>(options_.most_key_frames);
  KeyFrameId most_redundant = 0;
  double largest_share = -1;
  for (const auto& [id, frame] : map_.key_frames()) {
    if (id + kYoungKeyFrames > newest) break;
    if (frame.features.empty()) {
      redundant.push_back(id);
      continue;
    }
    int seen_elsewhere = 0, total = 0;
    for (const Feature& feature : frame.features) {
      const Landmark* landmark = map_.landmark(feature.landmark);
      if (landmark == nullptr) continue;
      ++total;
      seen_elsewhere += landmark->observations.size() > kRedundantViews;
    }
    const double share = total > 0 ? static_cast<double>(seen_elsewhere) / total : 1;
    if (share > kRedundantShare) redundant.push_back(id);
    if (share > largest_share) {
      largest_share = share;
      most_redundant = id;
    }
  }
  if (redundant.empty() && full && most_redundant != 0) redundant.push_back(most_redundant);
  // One at a time: what made two of them redundant may have been each other.
  if (!redundant.empty()) drop_key_frame(redundant.front());
}

void Mapper::drop_key_frame(KeyFrameId id) {
  const KeyFrame& gone = *map_.key_frame(id);
  KeyFrameId heir = 0;
  if (const auto covisible = map_.covisible(id); !covisible.empty()) {
    heir = covisible.front().first;
  } else {
    for (const auto& [other, frame] : map_.key_frames()) {
      if (other != id && frame.map == gone.map) heir = other;
    }
  }
  if (heir == 0) return;
  const KeyFrame& left = *map_.key_frame(heir);
  heirs_[id] = {heir, gone.T_camera_world * left.T_camera_world.inverse(), gone.scale, left.scale};
  places_.remove(id);
  map_.remove_key_frame(id);
}

void Mapper::index_place(KeyFrameId id) {
  const std::lock_guard lock(mutex_);
  const KeyFrame* frame = map_.key_frame(id);
  std::vector<Descriptor> descriptors;
  for (const LandmarkId hosted : frame->hosted) {
    const Landmark* landmark = map_.landmark(hosted);
    if (landmark != nullptr && landmark->described) descriptors.push_back(landmark->descriptor);
  }
  for (const Feature& feature : frame->features) {
    Descriptor descriptor;
    if (!feature.edgelet && describe(frame->image->level(feature.level), to_level(feature.pixel.x(), feature.level),
                                     to_level(feature.pixel.y(), feature.level), &descriptor)) {
      descriptors.push_back(descriptor);
    }
  }
  places_.add(id, descriptors);
}

KeyFrameId Mapper::ripe_key_frame() const {
  const std::lock_guard lock(mutex_);
  const int piece = piece_of(newest_);
  std::size_t younger = 0;
  for (auto frame = map_.key_frames().rbegin(); frame != map_.key_frames().rend(); ++frame) {
    if (frame->second.map == piece && younger++ == kRipe) return frame->first;
  }
  return 0;
}

void Mapper::close_loop(KeyFrameId id) {
  std::optional<LoopMatch> match;
  PoseGraph graph;
  std::vector<KeyFrameId> ids;
  bool metric = false;
  {
    const std::lock_guard lock(mutex_);
    const KeyFrame* query = map_.key_frame(id);
    if (query == nullptr) return;
    metric = query->prior.has_value();
    match = loop_closer_.find(map_, places_, id, metric);
    if (!match) return;
    const int from = query->map, into = map_.key_frame(match->place)->map;
    if (from != into) {
      // Another piece of map: it is brought over whole.
      const Similarity S_world_world = Similarity::from(map_.key_frame(match->place)->T_camera_world).inverse() *
                                       match->S_place_query * Similarity::from(query->T_camera_world);
      for (auto& [other, frame] : map_.key_frames()) {
        if (frame.map != from) continue;
        map_.move_key_frame(&frame, S_world_world);
        frame.map = into;
        corrections_.push_back({other, frame.sequence, frame.capture_time_ns, frame.T_camera_world.inverse()});
      }
    } else {
      std::map<KeyFrameId, int> index;
      for (const auto& [other, frame] : map_.key_frames()) {
        if (frame.map != into) continue;
        index[other] = static_cast<int>(graph.nodes.size());
        ids.push_back(other);
        graph.nodes.push_back({Similarity::from(frame.T_camera_world), other == match->place});
      }
      for (std::size_t i = 0; i < ids.size(); ++i) {
        const auto connect_nodes = [&](KeyFrameId other) {
          const auto j = static_cast<std::size_t>(index.at(other));
          graph.edges.push_back({static_cast<int>(i), static_cast<int>(j),
                                 graph.nodes[i].S_camera_world * graph.nodes[j].S_camera_world.inverse(), 1});
        };
        if (i > 0) connect_nodes(ids[i - 1]);
        int edges = 0;
        for (const auto& [other, shared] : map_.covisible(ids[i])) {
          if (shared < 20 || ++edges > 5) break;
          if (index.count(other) != 0 && other < ids[i] && (i == 0 || other != ids[i - 1])) connect_nodes(other);
        }
      }
      graph.edges.push_back(
          {index.at(match->place), index.at(id), match->S_place_query, static_cast<double>(ids.size())});
    }
  }
  if (!ids.empty()) {
    if (!optimise(&graph, !metric)) return;
    const std::lock_guard lock(mutex_);
    for (std::size_t i = 0; i < ids.size(); ++i) {
      KeyFrame* frame = map_.key_frame(ids[i]);
      if (frame == nullptr) continue;
      map_.move_key_frame(frame, graph.nodes[i].S_camera_world.inverse() * Similarity::from(frame->T_camera_world));
      corrections_.push_back({ids[i], frame->sequence, frame->capture_time_ns, frame->T_camera_world.inverse()});
    }
  }
  {
    const std::lock_guard lock(mutex_);
    ++loops_closed_;
    for (const auto& [kept, gone] : match->pairs) map_.merge_landmarks(kept, gone);
  }
  adjust_locally(id);
}

std::optional<Eigen::Isometry3d> Mapper::pose_of(KeyFrameId id) const {
  return pose_of(id, Eigen::Isometry3d::Identity(), 0);
}

std::optional<Eigen::Isometry3d> Mapper::pose_of(KeyFrameId id, const Eigen::Isometry3d& T_camera_reference,
                                                 double reference_scale) const {
  Eigen::Isometry3d T = T_camera_reference;
  for (auto heir = heirs_.find(id); heir != heirs_.end(); heir = heirs_.find(id)) {
    if (reference_scale > 0) T.translation() *= heir->second.gone_scale / reference_scale;
    T = T * heir->second.T_gone_heir;
    reference_scale = heir->second.heir_scale;
    id = heir->second.id;
  }
  const KeyFrame* frame = map_.key_frame(id);
  if (frame == nullptr) return std::nullopt;
  if (reference_scale > 0) T.translation() *= frame->scale / reference_scale;
  return T * frame->T_camera_world;
}

double Mapper::scale_of(KeyFrameId id) const {
  const KeyFrame* frame = map_.key_frame(id);
  return frame == nullptr ? 1 : frame->scale;
}

void Mapper::move_piece(int piece, const Similarity& S_new_old) {
  for (auto& [id, frame] : map_.key_frames()) {
    if (frame.map != piece) continue;
    map_.move_key_frame(&frame, S_new_old);
    corrections_.push_back({id, frame.sequence, frame.capture_time_ns, frame.T_camera_world.inverse()});
  }
}

int Mapper::piece_of(KeyFrameId id) const {
  for (auto heir = heirs_.find(id); heir != heirs_.end(); heir = heirs_.find(id)) id = heir->second.id;
  const KeyFrame* frame = map_.key_frame(id);
  return frame == nullptr ? 0 : frame->map;
}

std::vector<CorrectedPose> Mapper::take_corrections() {
  const std::lock_guard lock(mutex_);
  return std::exchange(corrections_, {});
}

}  // namespace vantage::tracking
