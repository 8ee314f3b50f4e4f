#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "lcmtypes/link/depth_map.h"
#include "offboard/planning/utility.h"
#include "offboard/planning/view_chooser.h"
#include "offboard/planning/volume.h"

namespace vantage {

struct PlannerOptions {
  std::int64_t first_view = 0;   ///< id of the view that is taken without a decision
  std::int64_t most_views = 20;  ///< stop after so many depth maps
  GainLimit enough = {};         ///< stop when no view gains as much (Eq. 13)
  double most_seconds = 0;       ///< stop so long after the first depth map, by the maps' own times; 0: never
  double most_way_m = 0;         ///< go no farther in all, by straight lines; stop when no view is as near; 0: no limit
};

/// What one depth map led to.
struct PlannerStep {
  std::int64_t step = 0;              ///< depth maps integrated, this one included
  std::int64_t view_id = 0;           ///< where it was taken
  double path_m = 0;                  ///< length of the polygon through all views so far
  std::vector<ScoredView> scores;     ///< of the candidates still open, by id; empty when a limit stopped first
  std::optional<CandidateView> next;  ///< nothing: the run is over
  std::string reason;                 ///< why this view, or why it is over
};

enum class PlannerState {
  kAwaitingMap,  ///< a goal is set; its depth map has not come
  kFinished
};

/// Next-best-view planning, one decision per depth map (paper.md, "Decision"): integrate → choose → stop or go.
///
/// Deterministic: the same maps in the same order give the same steps to the bit. Knows neither time nor network.
/// Visited views leave the candidate set.
class Planner {
 public:
  /// `volume` must outlive it. \throws InputError when there is no candidate `options.first_view`.
  Planner(Volume& volume, std::vector<CandidateView> candidates, std::unique_ptr<ViewChooser> chooser,
          const PlannerOptions& options);

  PlannerState state() const { return state_; }
  /// The view that is to be taken now; nothing when finished.
  const std::optional<CandidateView>& goal() const { return goal_; }

  /// Takes the depth map of the current goal, or of any other candidate (a replay of another planner's log). Nothing,
  /// with the reason in `why` and nothing changed, when the run is over or the map can't be integrated.
  std::optional<PlannerStep> take(const DepthMap& depth_map, std::string* why);

  /// The depth maps so far were taken elsewhere than they said, and the volume was made anew. \pre one pose of each
  void correct(std::vector<Eigen::Isometry3d> poses);

 private:
  void decide(const DepthMap& depth_map, PlannerStep* step);

  Volume& volume_;
  std::vector<CandidateView> open_;  // not visited yet, by id
  std::vector<std::int64_t> visited_;
  std::vector<Eigen::Isometry3d> poses_;  // of the visited views
  std::unique_ptr<ViewChooser> chooser_;
  PlannerOptions options_;
  GainStop enough_;
  PlannerState state_ = PlannerState::kAwaitingMap;
  std::optional<CandidateView> goal_;
  std::int64_t steps_ = 0;
  std::int64_t first_utime_ = 0;
  double path_m_ = 0;
  Eigen::Vector3d last_position_ = Eigen::Vector3d::Zero();
};

}  // namespace vantage
