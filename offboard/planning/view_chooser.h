#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "offboard/gain/view_gain.h"
#include "offboard/mapping/occupancy_map.h"
#include "offboard/planning/utility.h"
#include "offboard/planning/view_space.h"

namespace vantage {

/// What may be known when the next view is chosen.
struct Choice {
  const OccupancyMap& map;                   ///< of all views taken
  const CameraModel& camera;                 ///< of the depth maps
  std::span<const CandidateView> open;       ///< not visited yet and within the way left, by id; at least one
  std::span<const std::int64_t> visited;     ///< ids in order; at least one
  std::span<const Eigen::Isometry3d> poses;  ///< of the visited views, T_world_camera
  double way_left_m = std::numeric_limits<double>::infinity();  ///< of the run's limit, by straight lines
  /// Of the camera, world, m.
  Eigen::Vector3d position() const { return poses.back().translation(); }
};

struct ChosenView {
  std::size_t place = 0;           ///< in Choice::open
  std::vector<ScoredView> scores;  ///< what it went by, of each open view by place; empty: by nothing of the kind
  std::string reason;              ///< in words
};

/// A way to choose the next view. One object serves one run.
class ViewChooser {
 public:
  virtual ~ViewChooser() = default;
  /// The same run gives the same choices on every machine.
  virtual ChosenView choose(const Choice& choice) = 0;
};

/// G_v of a camera at each pose (T_world_camera) in the map.
using GainFunction = std::function<std::vector<double>(const OccupancyMap& map, const CameraModel& camera,
                                                       const std::vector<Eigen::Isometry3d>& poses)>;

/// Gains of a formulation, from so many rays a view.
GainFunction gain_of(Formulation formulation, int ray_columns, int ray_rows, const GainOptions& options = {});

/// The paper's decision (Eqs. 11 and 12); movement costs the distance between camera positions (Eq. 16).
class UtilityChooser : public ViewChooser {
 public:
  /// `cost_weight`: of the second term of Eq. 11, >= 0; 1 in the paper, 0: by gain alone.
  explicit UtilityChooser(GainFunction gain, double cost_weight = 1);
  ChosenView choose(const Choice& choice) override;

 private:
  GainFunction gain_;
  double cost_weight_;
};

/// UtilityChooser's choice by gains that are known, by place of `open`. \pre as many gains as views, at least one
ChosenView choose_by_utility(std::span<const CandidateView> open, const Eigen::Vector3d& position,
                             std::span<const double> gains, double cost_weight);

}  // namespace vantage
