#include "onboard/executive/executive.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "calib/files/input_error.h"

namespace vantage {
namespace {

using std::chrono::steady_clock;

constexpr std::chrono::milliseconds kControlPeriod{20};
constexpr std::chrono::milliseconds kAlivePeriod{200};  // between looks at an idle carrier
constexpr std::chrono::milliseconds kFramePatience{500};
constexpr std::chrono::seconds kFirstFramePatience{10};
constexpr int kFrameAttempts = 20;

}  // namespace

Executive::Executive(FrameSource& camera, CameraCarrier& carrier, ViewDepth& depth, const FlightLimits& limits)
    : camera_(camera), carrier_(carrier), depth_(depth), limits_(limits) {
  Frame frame;
  const FrameStatus status = camera_.next(&frame, kFirstFramePatience);
  if (status != FrameStatus::kFrame) {
    throw InputError("the camera gave no frame" + (camera_.end_reason().empty() ? "" : ": " + camera_.end_reason()));
  }
  if (std::string why; !depth_.fits(frame, &why)) throw InputError("the camera does not fit the rig: " + why);
  snapshot_.T_world_camera = *frame.T_world_camera;
  thread_ = std::thread([this] { run(); });
}

Executive::~Executive() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

bool Executive::take_goal(const ViewGoal& goal, std::string* why) {
  if (!is_rigid(goal.T_world_camera) || !std::all_of(goal.via.begin(), goal.via.end(), is_rigid)) {
    return *why = "one of its poses is not finite or not a rotation", false;
  }
  {
    const std::lock_guard lock(mutex_);
    next_goal_ = goal;
    hold_ = goal_reached_ = false;
    snapshot_.planner = goal.planner;
    snapshot_.goal_id = goal.goal_id;
    snapshot_.activity = RobotActivity::kMoving;
  }
  changed_.notify_all();
  return true;
}

void Executive::hold() {
  const std::lock_guard lock(mutex_);
  next_goal_.reset();
  hold_ = true;
  if (!goal_reached_) snapshot_.planner = snapshot_.goal_id = 0;
  snapshot_.activity = RobotActivity::kIdle;
}

RobotSnapshot Executive::snapshot() const {
  const std::lock_guard lock(mutex_);
  return snapshot_;
}

std::optional<DepthMap> Executive::fetch_depth_map() {
  std::optional<DepthMap> map;
  {
    const std::lock_guard lock(mutex_);
    map = std::exchange(finished_, std::nullopt);
  }
  if (map) changed_.notify_all();
  return map;
}

std::optional<Frame> Executive::fetch_frame() {
  const std::lock_guard lock(mutex_);
  return std::exchange(frame_, std::nullopt);
}

std::vector<KeyPose> Executive::fetch_corrections() {
  const std::lock_guard lock(mutex_);
  return std::exchange(corrections_, {});
}

std::optional<RobotEnd> Executive::ended() const {
  const std::lock_guard lock(mutex_);
  if (end_reason_.empty()) return std::nullopt;
  return RobotEnd{kExitPeerLost, end_reason_};
}

void Executive::end(const std::string& reason) {
  const std::lock_guard lock(mutex_);
  end_reason_ = reason.empty() ? "the camera's carrier has gone" : reason;
  snapshot_.activity = RobotActivity::kIdle;
}

bool Executive::superseded() const {
  const std::lock_guard lock(mutex_);
  return stop_ || hold_ || next_goal_.has_value();
}

void Executive::run() {
  for (;;) {
    ViewGoal goal;
    {
      std::unique_lock lock(mutex_);
      const bool woken = changed_.wait_for(
          lock, kAlivePeriod, [this] { return stop_ || (next_goal_ && !finished_) || !end_reason_.empty(); });
      if (stop_ || !end_reason_.empty()) return;
      if (woken) goal = *std::exchange(next_goal_, std::nullopt);
      if (!woken) {
        lock.unlock();
        if (!carrier_.alive()) end(camera_.end_reason());
        continue;
      }
    }
    const bool there = follow(goal);
    note_corrections();
    if (there && (!goal.expose || measure(goal))) arrive();
  }
}

/// True when the camera has arrived; false when another goal, a hold or the end came first.
bool Executive::fly(const Eigen::Isometry3d& to, Watch watch) {
  const FreeFlight flight(snapshot().T_world_camera, to, limits_);
  const steady_clock::time_point start = steady_clock::now();
  steady_clock::time_point tick = start;
  for (;;) {
    if (superseded()) return false;
    const double time_s = std::chrono::duration<double>(steady_clock::now() - start).count();
    const Eigen::Isometry3d pose = flight.pose_at(time_s);
    if (!carrier_.set_pose(pose)) {
      end(camera_.end_reason());
      return false;
    }
    {
      const std::lock_guard lock(mutex_);
      snapshot_.T_world_camera = pose;
    }
    if (time_s >= flight.duration_s()) return true;
    if (Frame frame; watch == Watch::kWay && depth_.watches_the_way() &&
                     camera_.next(&frame, kControlPeriod) == FrameStatus::kFrame) {
      depth_.pass(frame);
    }
    std::this_thread::sleep_until(tick += kControlPeriod);
  }
}

bool Executive::follow(const ViewGoal& goal) {
  return std::all_of(goal.via.begin(), goal.via.end(), [this](const auto& pose) { return fly(pose, Watch::kWay); }) &&
         fly(goal.T_world_camera, Watch::kWay);
}

void Executive::arrive() {
  const std::lock_guard lock(mutex_);
  if (next_goal_) return;
  goal_reached_ = !hold_;
  snapshot_.activity = RobotActivity::kIdle;
}

/// One frame from where the camera stands. False when another goal, a hold or the end came first.
bool Executive::expose(Frame* frame) {
  FrameStatus status = FrameStatus::kTimeout;
  for (int attempt = 0; attempt < kFrameAttempts && status == FrameStatus::kTimeout && !superseded(); ++attempt) {
    status = camera_.next(frame, kFramePatience);
  }
  if (superseded()) return false;
  if (status == FrameStatus::kFrame) return true;
  end(status == FrameStatus::kEnded ? camera_.end_reason() : "the camera gives no frames");
  return false;
}

void Executive::note_corrections() {
  const std::vector<KeyPose> corrected = depth_.corrections();
  const std::lock_guard lock(mutex_);
  corrections_.insert(corrections_.end(), corrected.begin(), corrected.end());
}

/// True when the view's depth map is there; false when another goal, a hold or the end came first.
bool Executive::measure(const ViewGoal& goal) {
  {
    const std::lock_guard lock(mutex_);
    if (next_goal_ || hold_) return false;
    snapshot_.activity = RobotActivity::kCapturing;
  }
  Frame key;
  if (!expose(&key)) return false;
  depth_.begin(key);
  while (const std::optional<Eigen::Isometry3d> pose = depth_.next_pose()) {
    Frame frame;
    if (!fly(*pose, Watch::kNo) || !expose(&frame)) return false;
    depth_.add(frame);
  }
  DepthMap map;
  if (std::string why; !depth_.finish(&map, &why)) {
    end(why);
    return false;
  }
  map.goal_id = goal.goal_id;
  map.view_id = goal.view_id;
  const std::lock_guard lock(mutex_);
  finished_ = std::move(map);
  frame_ = std::move(key);
  return true;
}

}  // namespace vantage
