#include "offboard/session/session.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <ostream>
#include <thread>
#include <utility>

#include <fmt/format.h>
#include <vantage/session_config_t.hpp>

#include "calib/files/atomic_file.h"
#include "calib/files/input_error.h"
#include "calib/files/ply.h"
#include "lcmtypes/link/depth_codec.h"
#include "lcmtypes/link/message_bus.h"
#include "lcmtypes/link/pose_fields.h"
#include "offboard/lookahead/view_set_planner.h"
#include "offboard/mapping/octomap_io.h"
#include "offboard/session/view_page.h"

namespace vantage {
namespace {

/// As many as the machine has cores, within reason. The gains do not depend on it.
int gain_threads() { return std::clamp(static_cast<int>(std::thread::hardware_concurrency()), 1, 16); }

std::vector<CandidateView> candidates_of(const PlanningConfig& planning) {
  return planning.views.empty() ? cylinder_views() : read_views(planning.views);
}

std::unique_ptr<ViewChooser> chooser_of(const PlanningConfig& planning) {
  if (planning.method == PlanningMethod::kViewSet) {
    ViewSetOptions options;
    options.expected.ground_m = planning.ground_m;
    return std::make_unique<ViewSetPlanner>(options);
  }
  GainOptions options;
  options.threads = gain_threads();
  return std::make_unique<UtilityChooser>(gain_of(planning.gain, planning.ray_columns, planning.ray_rows, options));
}

std::vector<Eigen::Vector3f> read_truth(const std::filesystem::path& path) {
  std::vector<Eigen::Vector3f> points = read_ply(path).points;
  if (points.empty()) throw InputError(path.string() + ": holds no point of the true surface");
  return points;
}

void copy_into(const std::filesystem::path& from, const std::filesystem::path& to) {
  std::error_code error;
  std::filesystem::copy_file(from, to, error);
  if (error) throw InputError(to.string() + ": can't be written: " + error.message());
}

std::ofstream open_table(const std::filesystem::path& path, const char* columns,
                         std::ios::openmode mode = std::ios::trunc) {
  std::ofstream table(path, std::ios::out | mode);
  if (table.tellp() == std::ofstream::pos_type(0)) table << columns << '\n' << std::flush;
  if (!table) throw InputError(path.string() + ": can't be written");
  return table;
}

std::string text_of(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

std::string minutes(double seconds) {
  const auto whole = std::llround(seconds);
  return fmt::format("{}:{:02}", whole / 60, whole % 60);
}

}  // namespace

Session::Session(const SessionConfig& config, const Clock& clock, std::ostream& terminal)
    : clock_(clock),
      terminal_(terminal),
      config_(config),
      volume_(config.region, config.sensor),
      cloud_(config.region, config.cloud),
      started_(clock.monotonic()) {
  if (config_.planning) {
    planner_ = std::make_unique<Planner>(volume_, candidates_of(*config_.planning), chooser_of(*config_.planning),
                                         config_.planning->planner);
  }
  if (!config_.truth.empty()) coverage_.emplace(read_truth(config_.truth), config_.coverage_distance_m);
}

Session::Session(const SessionConfig& inputs, const std::filesystem::path& folder, bool overwrite, const Clock& clock,
                 std::ostream& terminal)
    : Session(inputs, clock, terminal) {  // whatever can be wrong with the inputs is found before the folder is touched
  folder_ = make_session_folder(folder, overwrite);
  if (!config_.truth.empty()) {
    copy_into(config_.truth, folder_.truth());
    config_.truth = folder_.truth().filename();
  }
  if (config_.planning && !config_.planning->views.empty()) {
    copy_into(config_.planning->views, folder_.views());
    config_.planning->views = folder_.views().filename();
  }
  AtomicFile config_file(folder_.config());
  config_file.stream() << to_yaml(config_);
  config_file.commit();
  begin_log();
  open_tables(std::ios::trunc);
}

std::unique_ptr<Session> Session::resume(const std::filesystem::path& folder, const Clock& clock,
                                         std::ostream& terminal) {
  const SessionFolder files{folder};
  if (!std::filesystem::exists(files.config())) {
    throw InputError(folder.string() + ": holds no session to resume");
  }
  std::unique_ptr<Session> session(new Session(load_session_config(files.config()), clock, terminal));
  session->folder_ = files;
  session->config_ = parse_session_config(text_of(files.config()), files.config().string(), "");
  session->open_tables(std::ios::app | std::ios::ate);  // earlier times are kept
  session->read_log();
  return session;
}

void Session::begin_log() {
  log_ = std::make_unique<LogWriter>(folder_.log());
  session_config_t first;
  first.utime = clock_.utime();
  first.yaml = to_yaml(config_);
  log(channel::kSessionConfig, encode_message(first));
}

/// Brings the session to where its log ends, and the log to where it can go on.
void Session::read_log() {
  const auto decoded = [&](const LogEvent& event, auto* message) {
    DecodeCounters counters;
    if (decode_message(event.bytes, message, &counters)) return true;
    throw InputError(folder_.log().string() + ": event " + std::to_string(event.number) + " (" + event.channel +
                     "): does not decode");
  };
  std::uint64_t events = 0;
  if (std::filesystem::exists(folder_.log())) {
    LogReader reader(folder_.log(), {.accept_torn_end = true});
    for (LogEvent event; reader.next(&event); ++events) {
      if (motion_goal_t goal; event.channel == channel::kMotionGoal && decoded(event, &goal)) goal_before_ = goal;
      if (key_pose_t pose; event.channel == channel::kKeyPose && decoded(event, &pose)) move(pose);
      depth_map_t map;
      if (event.channel != channel::kDepthMap || !decoded(event, &map)) continue;
      std::string why;
      const std::optional<PlannerStep> step = use(map, &why);
      if (!step) {
        throw InputError(folder_.log().string() + ": event " + std::to_string(event.number) + ": " + why);
      }
      write_step(*step);
      taken_before_.push_back({map.session, map.map_id, digest_of(event.bytes)});
    }
  }
  if (events == 0) return begin_log();  // its program ended before the first event was whole
  log_ = LogWriter::resume(folder_.log());
  terminal_ << fmt::format("resumed after {} {}", steps_, planner_ ? "views" : "depth maps") << std::endl;
}

void Session::open_tables(std::ios::openmode timing_mode) {
  steps_file_ = open_table(folder_.steps(),
                           "step,view_id,path_m,occupied,free,uncertain,unobserved,entropy_nats,coverage,"
                           "next_view_id,next_gain,next_cost_m,next_utility,reason");
  scores_file_ = open_table(folder_.scores(), "step,view_id,gain,cost_m,utility");
  timing_file_ = open_table(folder_.timing(), "step,seconds_since_start,integrate_and_decide_s", timing_mode);
}

Session::~Session() = default;

const std::optional<CandidateView>& Session::goal() const {
  static const std::optional<CandidateView> kNone;
  return planner_ ? planner_->goal() : kNone;
}

void Session::log(std::string_view channel, std::span<const std::uint8_t> bytes) {
  log_->write(clock_.utime(), channel, bytes);
}

/// Integrates and decides; nothing, with the reason, when the depth map is refused.
std::optional<PlannerStep> Session::use(const depth_map_t& message, std::string* why) {
  const std::optional<DepthMap> depth_map = unpack_depth_map(message, why);
  if (!depth_map) return std::nullopt;
  make_anew_when_moved();
  PlannerStep step;
  if (planner_) {
    std::optional<PlannerStep> taken = planner_->take(*depth_map, why);
    if (!taken) return std::nullopt;
    step = std::move(*taken);
  } else {
    const IntegrationResult integrated = volume_.integrate(*depth_map);
    if (!integrated.ok) return *why = integrated.error, std::nullopt;
    if (!cameras_.empty()) path_m_ += (depth_map->T_world_camera.translation() - cameras_.back().translation()).norm();
    step.step = steps_ + 1;
    step.view_id = depth_map->view_id;
    step.path_m = path_m_;
    step.reason = "integrated";
  }
  steps_ = step.step;
  depth_maps_.push_back(message);
  show(*depth_map);
  if (finished()) finish_reason_ = step.reason;
  return step;
}

void Session::show(const DepthMap& depth_map) {
  cameras_.push_back(depth_map.T_world_camera);
  const std::vector<Eigen::Vector3f> added = cloud_.add(depth_map);
  if (coverage_) coverage_->add(added);
}

bool Session::correct(const key_pose_t& message) {
  if (!move(message)) return false;
  log(channel::kKeyPose, encode_message(message));
  return true;
}

bool Session::move(const key_pose_t& message) {
  const auto found = std::find_if(depth_maps_.begin(), depth_maps_.end(), [&](const depth_map_t& map) {
    return map.session == message.session && map.map_id == message.map_id;
  });
  if (finished() || found == depth_maps_.end() || !pose_of(message)) return false;
  if (std::equal(message.position, message.position + 3, found->position) &&
      std::equal(message.quaternion_xyzw, message.quaternion_xyzw + 4, found->quaternion_xyzw)) {
    return false;
  }
  std::copy(message.position, message.position + 3, found->position);
  std::copy(message.quaternion_xyzw, message.quaternion_xyzw + 4, found->quaternion_xyzw);
  return moved_ = true;
}

/// Clamping forgets, so that a depth map can't be taken out of the map: all go in again.
void Session::make_anew_when_moved() {
  if (!std::exchange(moved_, false)) return;
  volume_.clear();
  cloud_.clear();
  if (coverage_) coverage_->clear();
  cameras_.clear();
  for (const depth_map_t& message : depth_maps_) {
    std::string why;
    const std::optional<DepthMap> depth_map = unpack_depth_map(message, &why);
    volume_.integrate(*depth_map);  // it was taken before
    show(*depth_map);
  }
  if (planner_) planner_->correct(cameras_);
}

bool Session::take(const depth_map_t& message, std::string* why) {
  const std::chrono::nanoseconds begin = clock_.monotonic();
  const std::optional<PlannerStep> step = use(message, why);
  if (!step) return false;
  log(channel::kDepthMap, encode_message(message));
  write_step(*step);
  report(*step, std::chrono::duration<double>(clock_.monotonic() - begin).count());
  return true;
}

void Session::write_step(const PlannerStep& step) {
  const VoxelCounts counts = map().counts();
  steps_file_ << fmt::format("{},{},{},{},{},{},{},{},{},", step.step, step.view_id, step.path_m, counts.occupied,
                             counts.free, counts.uncertain, counts.unobserved, map().entropy_nats(),
                             coverage_ ? fmt::format("{}", coverage_->share()) : "");
  for (const ScoredView& view : step.scores) {
    scores_file_ << fmt::format("{},{},{},{},{}\n", step.step, view.view_id, view.gain, view.cost, view.utility);
    if (step.next && view.view_id == step.next->id) {
      steps_file_ << fmt::format("{},{},{},{},", view.view_id, view.gain, view.cost, view.utility);
    }
  }
  if (!step.next) steps_file_ << ",,,,";
  steps_file_ << step.reason << '\n' << std::flush;
  scores_file_ << std::flush;
  if (!steps_file_ || !scores_file_)
    throw InputError(folder_.steps().string() + ": writing failed (is the disk full?)");
}

void Session::report(const PlannerStep& step, double seconds) {
  const double elapsed_s = std::chrono::duration<double>(clock_.monotonic() - started_).count();
  timing_file_ << fmt::format("{},{:.3f},{:.4f}\n", step.step, elapsed_s, seconds) << std::flush;
  std::string line;
  if (planner_) {
    const std::int64_t most = config_.planning->planner.most_views;
    line = fmt::format("view {} of {}: no. {}", step.step, most, step.view_id);
  } else {
    line = fmt::format("depth map {}", step.step);
  }
  line += fmt::format(", path {:.2f} m, entropy {:.0f} nats", step.path_m, map().entropy_nats());
  if (coverage_) line += fmt::format(", coverage {:.3f}", coverage_->share());
  if (planner_) {
    if (step.next) {
      const auto left = static_cast<double>(config_.planning->planner.most_views - step.step);
      line += fmt::format("; next no. {}, {} left", step.next->id,
                          minutes(left * elapsed_s / static_cast<double>(step.step)));
    } else {
      line += "; " + step.reason;
    }
  }
  terminal_ << line << std::endl;
}

void Session::write_results() {
  make_anew_when_moved();
  write_map(folder_.map(), map());
  write_ply(folder_.mesh(), extract_mesh(volume_.tsdf()));
  const PlyModel cloud{cloud_.points(), cloud_.normals(), {}};
  write_ply(folder_.cloud(), cloud);
  write_view_page(folder_.page(), cloud, cameras_, summary());
}

std::string Session::summary() const {
  const char* unit = planner_ ? "views" : "depth maps";
  if (coverage_) return fmt::format("coverage {:.3f} after {} {}", coverage_->share(), steps_, unit);
  return fmt::format("{} occupied voxels after {} {}", map().counts().occupied, steps_, unit);
}

}  // namespace vantage
