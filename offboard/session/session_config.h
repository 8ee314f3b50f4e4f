#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "offboard/gain/formulation.h"
#include "offboard/mapping/region.h"
#include "offboard/mapping/sensor_model.h"
#include "offboard/planning/planner.h"
#include "offboard/session/surface_cloud.h"

namespace vantage {

/// By what the next view is chosen.
enum class PlanningMethod {
  kUtility,  ///< the paper's: a gain against the way (UtilityChooser)
  kViewSet   ///< several views ahead (ViewSetPlanner)
};

/// "utility" or "view_set"; nothing for another name, with the names there are in `why`.
std::optional<PlanningMethod> parse_planning_method(const std::string& name, std::string* why);

/// How views are chosen.
struct PlanningConfig {
  PlanningMethod method = PlanningMethod::kUtility;
  std::filesystem::path views;  ///< candidate file; empty: the paper's 48 views on cylinder and half-sphere
  Formulation gain = Formulation::kCombined;  ///< with the paper's weights for simulation; of kUtility, as the rays
  int ray_columns = 80, ray_rows = 60;
  double ground_m = 0;  ///< height of what the object stands on, world; of kViewSet
  PlannerOptions planner;
};

/// Everything that decides what a session does with the depth maps that come in. It is the first event of the session's
/// log, so that a replay needs nothing else.
struct SessionConfig {
  Region region = Region::cube({0, 0, 0.6}, 1.28, 0.01);  ///< paper.md: a cube of 1.28 m at 1 cm, on the ground
  SensorModel sensor;
  std::optional<PlanningConfig> planning = PlanningConfig{};  ///< nothing: maps are integrated, no view is chosen
  SurfaceCloudOptions cloud;
  std::filesystem::path truth;         ///< PLY with points of the true surface; empty: not known
  double coverage_distance_m = 0.008;  ///< Eq. 14
};

/// Reads a configuration; every key is optional but `config_version`, paths are relative to `folder`.
/// \throws InputError "name:line: key: …" for an unknown key, a wrong type or unit, values that contradict themselves.
SessionConfig parse_session_config(const std::string& text, const std::string& name,
                                   const std::filesystem::path& folder);
SessionConfig load_session_config(const std::filesystem::path& path);

/// The same configuration as text; parse_session_config gives it back to the bit.
std::string to_yaml(const SessionConfig& config);

}  // namespace vantage
