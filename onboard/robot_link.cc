#include "onboard/robot_link.h"

#include <utility>

#include <spdlog/spdlog.h>
#include <vantage/key_pose_t.hpp>

#include "calib/files/input_error.h"
#include "lcmtypes/link/depth_codec.h"
#include "lcmtypes/link/pose_fields.h"
#include "lcmtypes/link/robot_activity.h"
#include "lcmtypes/link/waypoints.h"
#include "onboard/preview_image.h"

namespace vantage {
namespace {

constexpr std::chrono::milliseconds kStatePeriod{100};
constexpr std::chrono::milliseconds kReceivePatience{1};
constexpr std::chrono::milliseconds kKeyPosePeriod{250};

}  // namespace

RobotLink::RobotLink(MessageBus& bus, const Clock& clock, RobotBody& body, const std::string& version,
                     RobotLinkOptions options)
    : bus_(bus),
      clock_(clock),
      body_(body),
      options_(std::move(options)),
      presence_(bus, clock, Role::kRobot, version),
      sender_(bus, clock, options_.sender),
      gate_(presence_.boot_id()),
      status_(bus, clock, Role::kRobot, presence_.boot_id(), [this] { return counters(); }),
      refusals_(clock),
      spool_words_(clock) {
  subscribe_message<command_t>(bus_, channel::kCommand, &commands_,
                               [this](const command_t& command) { on_command(command); });
  if (const std::uint64_t maps = sender_.spool().taken_over(); maps > 0) {
    spdlog::info("{} depth maps of an earlier start wait in the spool", maps);
  }
}

bool RobotLink::step(RobotEnd* end) {
  bus_.handle(kReceivePatience);
  presence_.step();
  send_finished_map();
  sender_.step();
  send_key_poses();
  send_preview();
  status_.step();
  if (clock_.monotonic() - last_state_ >= kStatePeriod) send_state();
  return body_has_ended(end) || planner_has_gone(end);
}

void RobotLink::on_command(const command_t& command) {
  if (!gate_.admit(command, clock_.utime())) {
    if (refusals_.due()) {
      const CommandGate::Counters& c = gate_.counters();
      spdlog::warn("commands refused so far: {} replayed or overtaken, {} expired, {} for another start, {} others",
                   c.not_rising, c.expired, c.other_robot, c.too_long + c.unknown_kind);
    }
    return;
  }
  presence_.set_command_counter(gate_.counter());
  switch (static_cast<CommandKind>(command.kind)) {
    case CommandKind::kGoal:
      if (motion_goal_t goal; decode_message(command.payload, &goal, &payloads_)) {
        on_goal(goal);
      } else {
        ++refused_goals_;
      }
      return;
    case CommandKind::kTrajectory:
      if (trajectory_t trajectory; decode_message(command.payload, &trajectory, &payloads_)) {
        on_trajectory(trajectory);
      } else {
        ++refused_goals_;
      }
      return;
    case CommandKind::kStop:
      return halt(Halt::kStopped);
    case CommandKind::kPause:
      return halt(halt_ == Halt::kStopped ? Halt::kStopped : Halt::kPaused);
    case CommandKind::kResume:
      if (halt_ != Halt::kNone) spdlog::info("resumed");
      halt_ = Halt::kNone;
      send_state();
  }
}

void RobotLink::halt(Halt halt) {
  body_.hold();
  if (halt_ != halt)
    spdlog::warn("{}: the camera stands still until a resume", halt == Halt::kStopped ? "stop" : "pause");
  halt_ = halt;
  send_state();
}

void RobotLink::on_goal(const motion_goal_t& message) {
  const RobotSnapshot now = body_.snapshot();
  if (message.planner == now.planner && message.goal_id <= now.goal_id) return;  // it is sent until it is taken up
  if (halt_ != Halt::kNone) {
    ++refused_goals_;
    return;
  }
  const std::optional<Eigen::Isometry3d> pose = pose_of(message);
  std::string why = "its pose is not finite or not a rotation";
  if (!pose || !body_.take_goal({message.planner, message.goal_id, message.view_id, *pose}, &why)) {
    ++refused_goals_;
    if (refusals_.due()) spdlog::warn("goal {} refused: {}", message.goal_id, why);
    return;
  }
  spdlog::info("goal {}: moving to view {}", message.goal_id, message.view_id);
  send_state();
}

void RobotLink::on_trajectory(const trajectory_t& message) {
  const RobotSnapshot now = body_.snapshot();
  if (message.sender == now.planner && message.trajectory_id <= now.goal_id) return;  // it is sent until it is taken up
  const std::optional<std::vector<Eigen::Isometry3d>> way = waypoints_of(message);
  ViewGoal goal{message.sender, message.trajectory_id, -1};
  goal.expose = false;
  if (way && !way->empty()) {
    goal.T_world_camera = way->back();
    goal.via.assign(way->begin(), way->end() - 1);
  }
  std::string why = "the robot is stopped, or a waypoint is no pose";
  if (halt_ == Halt::kStopped || !way || way->empty() || !body_.take_goal(goal, &why)) {
    ++refused_goals_;
    if (refusals_.due()) spdlog::warn("trajectory refused: {}", why);
    return;
  }
  spdlog::info("trajectory of {} waypoints", way->size());
  send_state();
}

void RobotLink::send_state() {
  const RobotSnapshot now = body_.snapshot();
  robot_state_t state;
  state.utime = clock_.utime();
  state.session = presence_.boot_id();
  state.planner = now.planner;
  state.goal_id = now.goal_id;
  state.activity = static_cast<std::int8_t>(halt_ == Halt::kStopped  ? RobotActivity::kStopped
                                            : halt_ == Halt::kPaused ? RobotActivity::kPaused
                                                                     : now.activity);
  set_pose(now.T_world_camera, &state);
  publish_message(bus_, channel::kRobotState, state);
  last_state_ = clock_.monotonic();
}

void RobotLink::send_finished_map() {
  std::optional<DepthMap> map = body_.fetch_depth_map();
  if (!map) return;
  map_at_[map->utime] = maps_ + 1;
  // The camera stamps by the monotonic clock; the network's times count from 1970.
  map->utime += clock_.utime() - std::chrono::duration_cast<std::chrono::microseconds>(clock_.monotonic()).count();
  map->session = static_cast<std::uint64_t>(presence_.boot_id());
  map->map_id = ++maps_;
  if (!sender_.enqueue(pack_depth_map(*map)) && spool_words_.due()) {
    spdlog::warn("the spool is full: {} depth maps have been given up so far, the oldest first",
                 sender_.spool().given_up());
  }
}

/// Those that were moved just now, and in turn all that ever were: who missed one, or has just come, hears it then.
void RobotLink::send_key_poses() {
  for (const KeyPose& pose : body_.fetch_corrections()) {
    const auto map = map_at_.find(pose.utime);
    if (map == map_at_.end()) continue;
    key_poses_[map->second] = pose.T_world_camera;
    send_key_pose(map->second);
  }
  if (key_poses_.empty() || clock_.monotonic() - key_pose_sent_ < kKeyPosePeriod) return;
  const auto next = key_poses_.upper_bound(last_key_pose_);
  send_key_pose(next == key_poses_.end() ? key_poses_.begin()->first : next->first);
}

void RobotLink::send_key_pose(std::int64_t map_id) {
  key_pose_t message;
  message.utime = clock_.utime();
  message.session = presence_.boot_id();
  message.map_id = map_id;
  set_pose(key_poses_.at(map_id), &message);
  publish_message(bus_, channel::kKeyPose, message);
  last_key_pose_ = map_id;
  key_pose_sent_ = clock_.monotonic();
}

/// The latest frame, when no depth map waits.
void RobotLink::send_preview() {
  if (std::optional<Frame> frame = body_.fetch_frame()) {
    preview_ = preview_of(frame->image);
    preview_->utime = clock_.utime();
    preview_->session = presence_.boot_id();
  }
  if (!preview_ || !sender_.spare(preview_->jpeg.size())) return;
  publish_message(bus_, channel::kPreview, *preview_);
  preview_.reset();
  ++previews_sent_;
}

/// A line for every planner that comes.
void RobotLink::tell_of_planner() {
  if (presence_.peer_boot_id() == known_planner_) return;
  known_planner_ = presence_.peer_boot_id();
  spdlog::info("planner version {} is there", presence_.peer_version());
}

/// An end that is a good one waits until the planner has every depth map.
bool RobotLink::body_has_ended(RobotEnd* end) {
  std::optional<RobotEnd> ended = body_.ended();
  if (!ended) return false;
  if (ended->exit_status == kExitOk && sender_.spool().size() > 0 && presence_.peer() != PeerPhase::kLost) return false;
  *end = std::move(*ended);
  return true;
}

bool RobotLink::planner_has_gone(RobotEnd* end) {
  switch (presence_.peer()) {
    case PeerPhase::kAwaited:
      return false;
    case PeerPhase::kRunning:
      tell_of_planner();
      if (std::exchange(holding_, false)) spdlog::info("the planner is back");
      return false;
    case PeerPhase::kUnfit:
      if (options_.on_lost_planner == OnLostPlanner::kEnd) {
        *end = {kExitPeerLost, presence_.peer_message()};
        return true;
      }
      if (refusals_.due()) spdlog::error("{}", presence_.peer_message());
      return false;
    case PeerPhase::kFinished:
      *end = {kExitOk, "the planner has finished: " + presence_.peer_message()};
      return true;
    case PeerPhase::kFailed:
      *end = {kExitPeerLost, "the planner has given up: " + presence_.peer_message()};
      return true;
    case PeerPhase::kLost:
      break;
  }
  if (options_.on_lost_planner == OnLostPlanner::kEnd) {
    *end = {kExitPeerLost, "the planner has gone: no heartbeat for 3 s"};
    return true;
  }
  if (!std::exchange(holding_, true)) {
    spdlog::warn("no heartbeat of the planner for 3 s: the camera stands still");
    body_.hold();
  }
  return false;
}

Status::Counters RobotLink::counters() const {
  const CommandGate::Counters& c = gate_.counters();
  Status::Counters all = {{"commands.accepted", c.accepted},
                          {"commands.not_rising", c.not_rising},
                          {"commands.expired", c.expired},
                          {"commands.other_robot", c.other_robot},
                          {"commands.too_long", c.too_long},
                          {"commands.unknown_kind", c.unknown_kind},
                          {"goals.refused", refused_goals_},
                          {"depth_maps.made", maps_},
                          {"depth_maps.acknowledged", sender_.acknowledged()},
                          {"depth_maps.spooled", sender_.spool().size()},
                          {"depth_maps.given_up", sender_.spool().given_up()},
                          {"depth_maps.taken_over", sender_.spool().taken_over()},
                          {"depth_maps.unreadable", sender_.spool().unreadable()},
                          {"depth_maps.moved", static_cast<std::int64_t>(key_poses_.size())},
                          {"chunks.sent", sender_.chunks_sent()},
                          {"chunks.sent_again", sender_.chunks_sent_again()},
                          {"previews.sent", previews_sent_},
                          {"planner.restarts", presence_.peer_restarts()}};
  if (const std::optional<ClockOffset> offset = presence_.clock_offset()) {
    all.emplace_back("planner.clock_offset_us", offset->offset_us);
    all.emplace_back("planner.clock_uncertainty_us", offset->uncertainty_us);
  }
  add_decode_counters("door.commands", commands_, &all);
  add_decode_counters("door.payloads", payloads_, &all);
  add_decode_counters("door.heartbeats", presence_.decode_counters(), &all);
  add_decode_counters("door.receipts", sender_.decode_counters(), &all);
  if (options_.more_counters) {
    for (auto& counter : options_.more_counters()) all.push_back(std::move(counter));
  }
  return all;
}

}  // namespace vantage
