#include "onboard/tracking/mapper.h"

#include <algorithm>
#include <stdexcept>

#include "onboard/tracking/descriptor.h"
#include "onboard/tracking/landmark_search.h"
#include "onboard/tracking/pose_refinement.h"

namespace vantage::tracking {
namespace {

constexpr std::size_t kMostFrames = 4;  // that wait for their seeds' update

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
  for (const KeyFrameId id : gone) forget_key_frame(id);
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

std::optional<Eigen::Isometry3d> Mapper::pose_of(KeyFrameId id) const {
  return pose_of(id, Eigen::Isometry3d::Identity(), 0);
}

std::optional<Eigen::Isometry3d> Mapper::pose_of(KeyFrameId id, const Eigen::Isometry3d& T_camera_reference,
                                                 double reference_scale) const {
  Eigen::Isometry3d T = T_camera_reference;
  if (const auto heir = heirs_.find(id); heir != heirs_.end()) {
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
    note_correction(frame);
  }
}

int Mapper::piece_of(KeyFrameId id) const {
  if (const auto heir = heirs_.find(id); heir != heirs_.end()) id = heir->second.id;
  const KeyFrame* frame = map_.key_frame(id);
  return frame == nullptr ? 0 : frame->map;
}

std::vector<CorrectedPose> Mapper::take_corrections() {
  const std::lock_guard lock(mutex_);
  std::vector<CorrectedPose> taken;
  for (const auto& [id, correction] : corrections_) taken.push_back(correction);
  corrections_.clear();
  return taken;
}

void Mapper::note_correction(const KeyFrame& frame) {
  corrections_[frame.id] = {frame.id, frame.sequence, frame.capture_time_ns, frame.T_camera_world.inverse()};
}

MapSize Mapper::size() const {
  const std::lock_guard lock(mutex_);
  MapSize size;
  size.key_frames = map_.key_frames().size();
  size.landmarks = map_.landmarks();
  for (const auto& [id, frame] : map_.key_frames()) size.observations += frame.features.size();
  size.heirs = heirs_.size();
  size.corrections = corrections_.size();
  return size;
}

}  // namespace vantage::tracking
