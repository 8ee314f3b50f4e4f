#include "offboard/planner_link.h"

#include <utility>

#include <spdlog/spdlog.h>

#include "calib/files/input_error.h"
#include "lcmtypes/link/digest.h"
#include "lcmtypes/link/pose_fields.h"
#include "lcmtypes/link/robot_activity.h"

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
      commands_(bus, clock, presence_),
      receiver_(bus, clock, [this](const depth_map_t& map) { on_depth_map(map); }),
      status_(bus, clock, Role::kPlanner, presence_.boot_id(), [this] { return counters(); }),
      refusals_(clock),
      waiting_words_(clock),
      start_(clock.monotonic()) {
  // Ids start at random, so that no old map answers a new goal. A resumed session goes on with its own: the robot may
  // be on its way still, or have the map.
  goal_.planner = presence_.boot_id();
  goal_.goal_id = random_id() >> kGoalIdStepBits << kGoalIdStepBits;
  goal_.view_id = -1;
  if (session.goal_before()) goal_ = *session.goal_before();
  for (const Session::TakenMap& taken : session.taken_before()) {
    receiver_.remember(taken.session, taken.map_id, taken.digest);
  }
  subscribe_message<robot_state_t>(bus_, channel::kRobotState, &states_,
                                   [this](const robot_state_t& state) { on_robot_state(state); });
  subscribe_message<status_t>(bus_, channel::kStatus, &statuses_, [this](const status_t& status) {
    session_.log(channel::kStatus, encode_message(status));  // the robot's and our own
  });
  subscribe_message<key_pose_t>(bus_, channel::kKeyPose, &key_poses_,
                                [this](const key_pose_t& pose) { moved_maps_ += session_.correct(pose) ? 1 : 0; });
  subscribe_message<preview_t>(bus_, channel::kPreview, &previews_, [this](const preview_t& preview) {
    if (preview.session == presence_.peer_boot_id()) session_.log(channel::kPreview, encode_message(preview));
  });
}

bool PlannerLink::step(PlannerEnd* end) {
  bus_.handle(kReceivePatience);
  receiver_.step();
  presence_.step();
  status_.step();
  if (session_.finished()) {
    *end = {kExitOk, session_.finish_reason()};
    return true;
  }
  send_goal_when_due();
  return robot_has_gone(end);
}

void PlannerLink::say_finished(const std::string& message) {
  presence_.say_finished(message);
  session_.log(channel::kStatus, encode_message(status_.current()));
}

void PlannerLink::on_depth_map(const depth_map_t& map) {
  if (session_.finished()) return;
  std::string why = "it answers another goal";
  // A resumed session's goal counts before it has been sent again: the robot may have had its answer ready all along.
  const bool wanted = !session_.planning() || (map.goal_id == goal_.goal_id && goal_.view_id == session_.goal()->id);
  if (wanted && session_.take(map, &why)) return;
  ++refused_maps_;
  if (refusals_.due()) spdlog::warn("depth map {} refused: {}", map.map_id, why);
}

void PlannerLink::on_robot_state(const robot_state_t& state) {
  goal_taken_up_ = goal_set_ && state.planner == goal_.planner && state.goal_id == goal_.goal_id;
  if (is_halted(state.activity)) {
    goal_since_ = clock_.monotonic();  // it will not get there before somebody lets it go on
    if (waiting_words_.due()) spdlog::info("the robot is halted; vantage-command resume lets it go on");
  }
  session_.log(channel::kRobotState, encode_message(state));
}

/// Makes the session's view the goal, once.
void PlannerLink::set_goal() {
  const CandidateView& view = *session_.goal();
  if (goal_set_ && view.id == goal_.view_id) return;
  const bool resumed = !goal_set_ && view.id == goal_.view_id;
  goal_set_ = true;
  goal_taken_up_ = false;
  goal_since_ = clock_.monotonic();
  goal_sent_ = {};
  if (resumed) return;
  ++goal_.goal_id;
  goal_.view_id = view.id;
  goal_.utime = clock_.utime();
  set_pose(view.T_world_camera, &goal_);
  session_.log(channel::kMotionGoal, encode_message(goal_));
}

void PlannerLink::send_goal_when_due() {
  if (!session_.goal() || presence_.peer() != PeerPhase::kRunning) return;
  set_goal();
  const std::chrono::nanoseconds now = clock_.monotonic();
  if (goal_taken_up_ || (goal_sent_.count() != 0 && now - goal_sent_ < kGoalPeriod)) return;
  goal_.utime = clock_.utime();
  if (!commands_.send(CommandKind::kGoal, encode_message(goal_))) return;
  goal_sent_ = now;
  ++goals_sent_;
}

/// A line for every start of a robot.
void PlannerLink::tell_of_robot() {
  if (presence_.peer_boot_id() == known_robot_) return;
  spdlog::info("robot version {} {}", presence_.peer_version(), known_robot_ == 0 ? "is there" : "has started anew");
  known_robot_ = presence_.peer_boot_id();
  goal_taken_up_ = false;
}

bool PlannerLink::robot_has_gone(PlannerEnd* end) {
  const std::chrono::nanoseconds now = clock_.monotonic();
  const bool waits = options_.on_lost_robot == OnLostRobot::kWait;
  switch (presence_.peer()) {
    case PeerPhase::kAwaited:
      if (waits || now - start_ < options_.await_robot) return false;
      *end = {kExitPeerLost, "no robot was heard within " + std::to_string(options_.await_robot.count()) +
                                 " s: is vantage-onboard running on the same network, with the same key?"};
      return true;
    case PeerPhase::kRunning:
      tell_of_robot();
      if (!goal_set_ || now - goal_since_ < options_.await_depth_map) return false;
      *end = {kExitPeerLost, "the robot sent no depth map of view " + std::to_string(goal_.view_id) + " within " +
                                 std::to_string(options_.await_depth_map.count()) + " s"};
      return true;
    case PeerPhase::kUnfit:
      *end = {kExitPeerLost, presence_.peer_message()};
      return true;
    case PeerPhase::kFinished:
      if (!session_.planning()) {
        *end = {kExitOk, "the robot has finished: " + presence_.peer_message()};
        return true;
      }
      [[fallthrough]];
    case PeerPhase::kFailed:
      *end = {kExitPeerLost, "the robot has ended: " + presence_.peer_message()};
      break;
    case PeerPhase::kLost:
      *end = {kExitPeerLost, "the robot has gone: no heartbeat for 3 s"};
      break;
  }
  if (!waits) return true;
  goal_since_ = now;
  if (waiting_words_.due()) spdlog::warn("{}; waiting for it to come back", end->message);
  return false;
}

Status::Counters PlannerLink::counters() const {
  const DepthMapReceiver::Counters& r = receiver_.counters();
  Status::Counters all = {{"depth_maps.delivered", r.delivered},      {"depth_maps.refused", refused_maps_},
                          {"depth_maps.moved", moved_maps_},          {"depth_maps.set_aside", r.set_aside},
                          {"depth_maps.given_up", r.given_up},        {"depth_maps.wrong_digests", r.wrong_digests},
                          {"manifests.refused", r.refused_manifests}, {"chunks.duplicate", r.duplicate_chunks},
                          {"chunks.foreign", r.foreign_chunks},       {"goals.sent", goals_sent_},
                          {"session.steps", session_.steps()},        {"robot.restarts", presence_.peer_restarts()}};
  if (const std::optional<ClockOffset> offset = presence_.clock_offset()) {
    all.emplace_back("robot.clock_offset_us", offset->offset_us);
    all.emplace_back("robot.clock_uncertainty_us", offset->uncertainty_us);
  }
  add_decode_counters("door.depth_maps", receiver_.decode_counters(), &all);
  add_decode_counters("door.states", states_, &all);
  add_decode_counters("door.statuses", statuses_, &all);
  add_decode_counters("door.key_poses", key_poses_, &all);
  add_decode_counters("door.previews", previews_, &all);
  add_decode_counters("door.heartbeats", presence_.decode_counters(), &all);
  if (options_.more_counters) {
    for (auto& counter : options_.more_counters()) all.push_back(std::move(counter));
  }
  return all;
}

}  // namespace vantage
