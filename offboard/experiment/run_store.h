#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "offboard/experiment/method_run.h"

namespace vantage {

/// Names one run among all.
struct RunKey {
  std::string object, method;
  std::uint64_t seed = 0;
  bool operator==(const RunKey&) const = default;
};

/// What all runs of a folder have in common; runs made otherwise are not put beside them.
struct StoreSettings {
  int views = 20;
  double cost_weight = 1;
  int ray_columns = 80, ray_rows = 60;
  double clamp_min = 0.03, clamp_max = 0.97;
  double view_radius_m = 0.6;
  double most_way_m = 0;         ///< 0: no limit
  double known_share = 0.008;    ///< of view_set_known
  std::string weights = "none";  ///< digest of the learned weights
  struct Object {
    std::string name, digest;
    bool operator==(const Object&) const = default;
  };
  std::vector<Object> objects;
};

enum class StoreStart { kNew, kResume, kOverwrite };

/// The folder of an experiment.
///
///     settings.txt   what all runs have in common
///     runs/          one file a run, each whole or not there: what was finished survives any end
///     views/         packed depth maps by object and seed, made once; may be deleted (elsewhere with keep_views_in)
///     steps.csv, timing.csv, summary.csv: the same runs as tables
///
/// Several programs may add runs to one folder; a run that two of them make is there once.
class RunStore {
 public:
  /// Makes the folder, or opens it. kNew refuses a folder that holds an experiment, kOverwrite empties it, kResume adds
  /// to it. \throws InputError also when settings contradict those of the folder, or it can't be written.
  RunStore(std::filesystem::path folder, const StoreSettings& settings, StoreStart start);

  /// Opens a folder that holds an experiment. \throws InputError when it does not.
  explicit RunStore(std::filesystem::path folder);

  const StoreSettings& settings() const { return settings_; }
  const std::filesystem::path& folder() const { return folder_; }
  /// Another folder for packed depth maps, which experiments can share. \throws InputError when it can't be made.
  void keep_views_in(const std::filesystem::path& folder);
  /// For the packed depth maps of an object with a seed, at the settings' radius.
  std::filesystem::path views_of(const std::string& object_name, std::uint64_t seed) const;

  bool holds(const RunKey& key) const;
  void write(const MethodRun& run) const;
  /// All finished runs, in order of the settings' objects, then method_names(), then seeds.
  /// \throws InputError naming a file that is no run.
  std::vector<MethodRun> read() const;

 private:
  std::filesystem::path file_of(const RunKey& key) const;
  void write_settings() const;

  std::filesystem::path folder_, views_folder_;
  StoreSettings settings_;
};

/// Where a folder of packed depth maps keeps those of an object with a seed.
std::filesystem::path views_folder(const std::filesystem::path& folder, const StoreSettings::Object& object,
                                   std::uint64_t seed, double view_radius_m);

/// Tables of all runs in the store: steps.csv, timing.csv, summary.csv.
void write_tables(const std::filesystem::path& folder, const std::vector<MethodRun>& runs);

/// Puts runs of several stores into a new one at `out`. A run that is in several of them comes out once.
/// \throws InputError when stores have other views or other meshes under one name, or hold different steps of one run.
RunStore merge_stores(const std::vector<std::filesystem::path>& folders, const std::filesystem::path& out,
                      StoreStart start);

/// Motion of a run over the largest of any method on the same object and seed (Eq. 16); 0 when nobody moved.
double relative_motion(const MethodRun& run, const std::vector<MethodRun>& all);

}  // namespace vantage
