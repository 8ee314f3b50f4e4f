#pragma once

#include <chrono>
#include <cstdint>
#include <fstream>
#include <iosfwd>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <vantage/depth_map_t.hpp>
#include <vantage/key_pose_t.hpp>
#include <vantage/motion_goal_t.hpp>

#include "lcmtypes/link/clock.h"
#include "lcmtypes/link/digest.h"
#include "lcmtypes/link/event_log.h"
#include "offboard/planning/planner.h"
#include "offboard/session/session_config.h"
#include "offboard/session/session_folder.h"
#include "offboard/session/surface_coverage.h"

namespace vantage {

/// One run of the planner: takes depth maps, keeps the map, decides, and writes the session's folder as it goes.
///
/// Everything but timing.csv and the log's time stamps follows from the configuration and the depth maps alone: the
/// same log replayed gives the same files to the byte. Live and replayed sessions differ only in who calls `take`.
class Session {
 public:
  /// `inputs`: the configuration with paths that exist; files it names are copied into the folder first. `clock` and
  /// `terminal`, where a line a view is written, must outlive it.
  /// \throws InputError when a file of the configuration is not usable, or the folder is not.
  Session(const SessionConfig& inputs, const std::filesystem::path& folder, bool overwrite, const Clock& clock,
          std::ostream& terminal);
  /// Goes on with the session in `folder`, however its program ended: map, plan and tables are made anew from its log,
  /// which then grows on. \throws InputError when the folder holds no session, or its log is damaged.
  static std::unique_ptr<Session> resume(const std::filesystem::path& folder, const Clock& clock,
                                         std::ostream& terminal);
  ~Session();

  /// The view to be taken now; nothing when the run is over, or none is planned.
  const std::optional<CandidateView>& goal() const;
  bool planning() const { return planner_ != nullptr; }
  /// True when no further depth map is wanted.
  bool finished() const { return planner_ != nullptr && planner_->state() == PlannerState::kFinished; }
  /// Why it finished; empty before.
  const std::string& finish_reason() const { return finish_reason_; }

  /// Integrates a depth map, decides, logs. False, with the reason in `why` and nothing changed, when it is refused.
  bool take(const depth_map_t& message, std::string* why);

  /// An earlier depth map's key frame stands elsewhere: before the next decision the map is made anew with it there.
  /// False, and nothing changes, when the session is over, the depth map is not known, the message has no pose, or says
  /// what is known already.
  bool correct(const key_pose_t& message);

  /// A depth map of the log that a resumed session began with.
  struct TakenMap {
    std::int64_t session = 0, map_id = 0;
    Digest digest{};  ///< of the encoded message
  };
  const std::vector<TakenMap>& taken_before() const { return taken_before_; }
  /// The last goal of the log that a resumed session began with; nothing in a new one.
  const std::optional<motion_goal_t>& goal_before() const { return goal_before_; }

  /// Adds an accepted message to the log.
  void log(std::string_view channel, std::span<const std::uint8_t> bytes);

  /// Writes map.ot, mesh.ply, cloud.ply and view.html. \post no correction waits
  void write_results();

  /// "coverage 0.913 after 12 views" where the truth is known, else what the map holds.
  std::string summary() const;
  const OccupancyMap& map() const { return volume_.map(); }
  std::int64_t steps() const { return steps_; }

 private:
  Session(const SessionConfig& config, const Clock& clock, std::ostream& terminal);
  void begin_log();
  void read_log();
  void open_tables(std::ios::openmode timing_mode);
  std::optional<PlannerStep> use(const depth_map_t& message, std::string* why);
  bool move(const key_pose_t& message);
  void make_anew_when_moved();
  void show(const DepthMap& depth_map);
  void write_step(const PlannerStep& step);
  void report(const PlannerStep& step, double seconds);

  const Clock& clock_;
  std::ostream& terminal_;
  SessionConfig config_;
  Volume volume_;
  SurfaceCloud cloud_;
  std::optional<SurfaceCoverage> coverage_;
  std::unique_ptr<Planner> planner_;
  SessionFolder folder_;
  std::unique_ptr<LogWriter> log_;
  std::ofstream steps_file_, scores_file_, timing_file_;
  std::chrono::nanoseconds started_;
  std::int64_t steps_ = 0;
  double path_m_ = 0;
  std::vector<Eigen::Isometry3d> cameras_;  // of the depth maps taken
  std::vector<depth_map_t> depth_maps_;     // taken, packed, each where its key frame stands by now
  bool moved_ = false;                      // one of them, since the map was made
  std::string finish_reason_;
  std::vector<TakenMap> taken_before_;
  std::optional<motion_goal_t> goal_before_;
};

}  // namespace vantage
