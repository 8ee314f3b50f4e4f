#include "offboard/planner_link.h"

#include <utility>

#include <spdlog/spdlog.h>

#include "calib/files/input_error.h"
#include "lcmtypes/link/digest.h"
#include "lcmtypes/link/pose_fields.h"

namespace vantage {
namespace {

constexpr std::chrono::milliseconds kReceivePatience{2};
constexpr std::chrono::milliseconds kGoalPeriod{200};
constexpr int kGoalIdStepBits = 16;  // of a goal's id count the run's goals; the rest is random

}  // namespace

PlannerLink::PlannerLink(MessageBus& bus, const Clock& clock, Session& session, const std::string& version,
                         const PlannerLinkOptions& options)
    : bus_(bus),
      clock_(clock),
      session_(session),
      options_(options),
      presence_(bus, clock, Role::kPlanner, version),
      receiver_(bus, clock, [this](const depth_map_t& map) { on_depth_map(map); }),
      goal_id_(random_id() >> kGoalIdStepBits << kGoalIdStepBits),
      start_(clock.monotonic()) {
  subscribe_message<robot_state_t>(bus_, channel::kRobotState, &decode_,
                                   [this](const robot_state_t& state) { on_robot_state(state); });
}

bool PlannerLink::step(PlannerEnd* end) {
  bus_.handle(kReceivePatience);
  receiver_.step();
  presence_.step();
  take_waiting_maps();
  if (session_.finished()) {
    *end = {kExitOk, session_.finish_reason()};
    return true;
  }
  send_goal_when_due();
  return robot_has_gone(end);
}

void PlannerLink::on_depth_map(const depth_map_t& map) { waiting_.push_back(map); }

void PlannerLink::take_waiting_maps() {
  // Not within the receiver's handler: its receipt should go out before a decision takes its time.
  while (!waiting_.empty() && !session_.finished()) {
    const depth_map_t map = std::move(waiting_.front());
    waiting_.pop_front();
    if (session_.planning() && map.goal_id != goal_id_) {
      ++refused_maps_;
      spdlog::warn("depth map {} refused: it answers another goal", map.map_id);
      continue;
    }
    if (std::string why; !session_.take(map, &why)) {
      ++refused_maps_;
      spdlog::warn("depth map {} refused: {}", map.map_id, why);
    }
  }
}

void PlannerLink::on_robot_state(const robot_state_t& state) {
  if (state.planner == presence_.boot_id() && state.goal_id == goal_id_) goal_taken_up_ = true;
  session_.log(channel::kRobotState, encode_message(state));
}

void PlannerLink::send_goal_when_due() {
  if (!session_.goal() || presence_.peer() != PeerPhase::kRunning) return;
  const CandidateView& view = *session_.goal();
  const std::chrono::nanoseconds now = clock_.monotonic();
  const bool fresh = view.id != goal_view_;
  if (fresh) {
    ++goal_id_;
    goal_view_ = view.id;
    goal_taken_up_ = false;
    goal_since_ = now;
  }
  if (goal_taken_up_ || (!fresh && now - goal_sent_ < kGoalPeriod)) return;
  motion_goal_t goal;
  goal.utime = clock_.utime();
  goal.planner = presence_.boot_id();
  goal.goal_id = goal_id_;
  goal.view_id = view.id;
  set_pose(view.T_world_camera, &goal);
  publish_message(bus_, channel::kMotionGoal, goal);
  if (fresh) session_.log(channel::kMotionGoal, encode_message(goal));
  goal_sent_ = now;
}

bool PlannerLink::robot_has_gone(PlannerEnd* end) {
  const std::chrono::nanoseconds now = clock_.monotonic();
  switch (presence_.peer()) {
    case PeerPhase::kAwaited:
      if (now - start_ < options_.await_robot) return false;
      *end = {kExitPeerLost, "no robot was heard within " + std::to_string(options_.await_robot.count()) +
                                 " s: is vantage-onboard running on the same network?"};
      return true;
    case PeerPhase::kRunning:
      if (goal_view_ < 0 || now - goal_since_ < options_.await_depth_map) return false;
      *end = {kExitPeerLost, "the robot sent no depth map of view " + std::to_string(goal_view_) + " within " +
                                 std::to_string(options_.await_depth_map.count()) + " s"};
      return true;
    case PeerPhase::kFinished:
    case PeerPhase::kFailed:
      *end = {kExitPeerLost, "the robot has ended: " + presence_.peer_message()};
      return true;
    case PeerPhase::kLost:
      break;
  }
  *end = {kExitPeerLost, "the robot has gone: no heartbeat for 3 s"};
  return true;
}

}  // namespace vantage
