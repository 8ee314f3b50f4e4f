#include "onboard/robot_link.h"

#include <utility>

#include <spdlog/spdlog.h>

#include "calib/files/input_error.h"
#include "lcmtypes/link/depth_codec.h"
#include "lcmtypes/link/digest.h"
#include "lcmtypes/link/pose_fields.h"

namespace vantage {
namespace {

constexpr std::chrono::milliseconds kStatePeriod{100};
constexpr std::chrono::milliseconds kReceivePatience{1};

}  // namespace

RobotLink::RobotLink(MessageBus& bus, const Clock& clock, Executive& executive, const std::string& version,
                     OnLostPlanner on_lost_planner)
    : bus_(bus),
      clock_(clock),
      executive_(executive),
      on_lost_planner_(on_lost_planner),
      presence_(bus, clock, Role::kRobot, version),
      sender_(bus, clock),
      session_(random_id()) {
  subscribe_message<motion_goal_t>(bus_, channel::kMotionGoal, &decode_,
                                   [this](const motion_goal_t& goal) { on_goal(goal); });
}

bool RobotLink::step(RobotEnd* end) {
  bus_.handle(kReceivePatience);
  presence_.step();
  send_finished_map();
  sender_.step();
  if (clock_.monotonic() - last_state_ >= kStatePeriod) send_state();
  if (std::string reason; executive_.ended(&reason)) {
    *end = {kExitPeerLost, reason};
    return true;
  }
  return planner_has_gone(end);
}

void RobotLink::on_goal(const motion_goal_t& message) {
  const RobotSnapshot now = executive_.snapshot();
  if (message.planner == now.planner && message.goal_id <= now.goal_id) return;  // it is sent until it is taken up
  const std::optional<Eigen::Isometry3d> pose = pose_of(message);
  if (!pose || !executive_.take_goal({message.planner, message.goal_id, message.view_id, *pose})) {
    ++refused_goals_;
    spdlog::warn("goal {} refused: its pose is not finite or not a rotation", message.goal_id);
    return;
  }
  spdlog::info("goal {}: moving to view {}", message.goal_id, message.view_id);
  send_state();
}

void RobotLink::send_state() {
  const RobotSnapshot now = executive_.snapshot();
  robot_state_t state;
  state.utime = clock_.utime();
  state.session = session_;
  state.planner = now.planner;
  state.goal_id = now.goal_id;
  state.activity = static_cast<std::int8_t>(now.activity);
  set_pose(now.T_world_camera, &state);
  publish_message(bus_, channel::kRobotState, state);
  last_state_ = clock_.monotonic();
}

void RobotLink::send_finished_map() {
  std::optional<DepthMap> map = executive_.fetch_depth_map();
  if (!map) return;
  // The camera stamps by the monotonic clock; the network's times count from 1970.
  map->utime += clock_.utime() - std::chrono::duration_cast<std::chrono::microseconds>(clock_.monotonic()).count();
  map->session = static_cast<std::uint64_t>(session_);
  map->map_id = ++maps_;
  if (!sender_.enqueue(pack_depth_map(*map))) spdlog::warn("the spool is full: its oldest depth map was given up");
}

bool RobotLink::planner_has_gone(RobotEnd* end) {
  switch (presence_.peer()) {
    case PeerPhase::kAwaited:
      return false;
    case PeerPhase::kRunning:
      if (std::exchange(holding_, false)) spdlog::info("the planner is back");
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
  if (on_lost_planner_ == OnLostPlanner::kEnd) {
    *end = {kExitPeerLost, "the planner has gone: no heartbeat for 3 s"};
    return true;
  }
  if (!std::exchange(holding_, true)) {
    spdlog::warn("no heartbeat of the planner for 3 s: the camera stands still");
    executive_.hold();
  }
  return false;
}

}  // namespace vantage
