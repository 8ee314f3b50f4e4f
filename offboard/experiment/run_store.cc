#include "offboard/experiment/run_store.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <fstream>
#include <sstream>
#include <tuple>

#include <fmt/format.h>

#include "calib/files/atomic_file.h"
#include "calib/files/input_error.h"

namespace vantage {
namespace {

constexpr const char* kSettingsFile = "settings.txt";
constexpr const char* kRunColumns =
    "step,view_id,coverage,entropy_nats,motion_m,choose_s,load_s,integrate_s,measure_s,reachable";

std::vector<std::string> split(const std::string& line, char separator) {
  std::vector<std::string> fields;
  std::stringstream stream(line);
  for (std::string field; std::getline(stream, field, separator);) fields.push_back(field);
  return fields;
}

template <typename Number>
bool parse(const std::string& text, Number* number) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), *number);
  return error == std::errc() && end == text.data() + text.size();
}

/// All that runs of a folder have in common but the objects, as settings.txt has it: name and value a line.
std::vector<std::array<std::string, 2>> shared_values(const StoreSettings& s) {
  return {{"views", fmt::format("{}", s.views)},
          {"cost_weight", fmt::format("{}", s.cost_weight)},
          {"rays", fmt::format("{}x{}", s.ray_columns, s.ray_rows)},
          {"clamp", fmt::format("{},{}", s.clamp_min, s.clamp_max)},
          {"view_radius", fmt::format("{}", s.view_radius_m)},
          {"most_way", fmt::format("{}", s.most_way_m)},
          {"known_share", fmt::format("{}", s.known_share)},
          {"weights", s.weights}};
}

/// "80x60", "0.03,0.97".
template <typename Number>
bool parse_two(const std::string& text, char separator, Number* first, Number* second) {
  const std::vector<std::string> parts = split(text, separator);
  return parts.size() == 2 && parse(parts[0], first) && parse(parts[1], second);
}

/// Takes a line of settings.txt; false when it is none.
bool take_setting(const std::vector<std::string>& words, StoreSettings* s) {
  if (words.size() == 3 && words[0] == "object") {
    s->objects.push_back({words[1], words[2]});
    return true;
  }
  if (words.size() != 2) return false;
  const std::string &name = words[0], &value = words[1];
  if (name == "views") return parse(value, &s->views);
  if (name == "cost_weight") return parse(value, &s->cost_weight);
  if (name == "rays") return parse_two(value, 'x', &s->ray_columns, &s->ray_rows);
  if (name == "clamp") return parse_two(value, ',', &s->clamp_min, &s->clamp_max);
  if (name == "view_radius") return parse(value, &s->view_radius_m);
  if (name == "most_way") return parse(value, &s->most_way_m);
  if (name == "known_share") return parse(value, &s->known_share);
  if (name == "weights") return s->weights = value, true;
  return false;
}

StoreSettings read_settings(const std::filesystem::path& file) {
  std::ifstream stream(file);
  if (!stream) throw InputError(file.parent_path().string() + ": holds no experiment (no " + kSettingsFile + ")");
  StoreSettings settings;  // what an older version did not write had the value that is now the default
  std::string line;
  bool good = static_cast<bool>(std::getline(stream, line)) && line == "vantage-experiment 1";
  while (good && std::getline(stream, line)) good = take_setting(split(line, ' '), &settings);
  if (!good) throw InputError(file.string() + ": not written by this version of vantage-experiment; use another --out");
  return settings;
}

/// Adds the objects of `more`. \throws InputError, which starts with `where`, when they contradict.
void add_settings(const std::string& where, const StoreSettings& more, StoreSettings* settings) {
  const auto ours = shared_values(*settings), theirs = shared_values(more);
  for (std::size_t i = 0; i < ours.size(); ++i) {
    if (ours[i][1] == theirs[i][1]) continue;
    throw InputError(fmt::format("{}: runs with {} {} can't stand beside runs with {}; use another folder", where,
                                 ours[i][0], theirs[i][1], ours[i][1]));
  }
  for (const StoreSettings::Object& object : more.objects) {
    const auto same = std::find_if(settings->objects.begin(), settings->objects.end(),
                                   [&](const StoreSettings::Object& other) { return other.name == object.name; });
    if (same == settings->objects.end()) {
      settings->objects.push_back(object);
    } else if (same->digest != object.digest) {
      throw InputError(fmt::format("{}: holds runs of another mesh called {}; use another folder", where, object.name));
    }
  }
}

MethodRun read_run(const std::filesystem::path& file) {
  const auto wrong = [&] { return InputError(file.string() + ": not a run of this version; delete it"); };
  MethodRun run;
  const std::vector<std::string> name = split(file.stem().string(), '.');
  if (name.size() != 3 || !parse(name[2], &run.seed)) throw wrong();
  run.object = name[0];
  run.method = name[1];
  std::ifstream stream(file);
  std::string line;
  if (!std::getline(stream, line) || line != kRunColumns) throw wrong();
  while (std::getline(stream, line)) {
    const std::vector<std::string> fields = split(line, ',');
    MethodStep step;
    if (fields.size() != 10 || !parse(fields[0], &step.step) || !parse(fields[1], &step.view_id)) throw wrong();
    const std::array<double*, 8> numbers = {&step.coverage, &step.entropy_nats, &step.motion_m,  &step.choose_s,
                                            &step.load_s,   &step.integrate_s,  &step.measure_s, &run.reachable};
    for (std::size_t i = 0; i < numbers.size(); ++i) {
      if (!parse(fields[i + 2], numbers[i])) throw wrong();
    }
    run.steps.push_back(step);
  }
  if (run.steps.empty()) throw wrong();
  return run;
}

bool same_steps(const MethodRun& a, const MethodRun& b) {
  return std::equal(a.steps.begin(), a.steps.end(), b.steps.begin(), b.steps.end(),
                    [](const MethodStep& x, const MethodStep& y) {
                      return std::tie(x.step, x.view_id, x.coverage, x.entropy_nats, x.motion_m) ==
                             std::tie(y.step, y.view_id, y.coverage, y.entropy_nats, y.motion_m);
                    });
}

}  // namespace

RunStore::RunStore(std::filesystem::path folder, const StoreSettings& settings, StoreStart start)
    : folder_(std::move(folder)), views_folder_(folder_ / "views"), settings_(settings) {
  const bool there = std::filesystem::exists(folder_ / kSettingsFile);
  if (there && start == StoreStart::kNew) {
    throw InputError(folder_.string() + ": holds an experiment; add --resume to go on, or --overwrite to replace it");
  }
  std::error_code error;
  if (!there && std::filesystem::exists(folder_) && !std::filesystem::is_empty(folder_, error)) {
    throw InputError(folder_.string() + ": holds other files; give an empty or a new folder");
  }
  if (there && start == StoreStart::kOverwrite) {
    std::filesystem::remove_all(folder_ / "runs", error);
    std::filesystem::remove_all(folder_ / "views", error);
  }
  if (there && start == StoreStart::kResume) {
    settings_ = read_settings(folder_ / kSettingsFile);
    add_settings(folder_.string(), settings, &settings_);
  }
  std::filesystem::create_directories(folder_, error);
  if (error) throw InputError(folder_.string() + ": can't be made: " + error.message());
  write_settings();  // first of all: by this file the folder is known, should the program be killed
  std::filesystem::create_directories(folder_ / "runs", error);
  if (error) throw InputError((folder_ / "runs").string() + ": can't be made: " + error.message());
}

RunStore::RunStore(std::filesystem::path folder)
    : folder_(std::move(folder)), views_folder_(folder_ / "views"), settings_(read_settings(folder_ / kSettingsFile)) {}

void RunStore::write_settings() const {
  AtomicFile file(folder_ / kSettingsFile);
  file.stream() << "vantage-experiment 1\n";
  for (const auto& [name, value] : shared_values(settings_)) file.stream() << name << ' ' << value << '\n';
  for (const StoreSettings::Object& object : settings_.objects) {
    file.stream() << "object " << object.name << ' ' << object.digest << '\n';
  }
  file.commit();
}

std::filesystem::path RunStore::views_of(const std::string& object_name, std::uint64_t seed) const {
  const auto object = std::find_if(settings_.objects.begin(), settings_.objects.end(),
                                   [&](const StoreSettings::Object& other) { return other.name == object_name; });
  return views_folder(views_folder_,
                      object == settings_.objects.end() ? StoreSettings::Object{object_name, ""} : *object, seed,
                      settings_.view_radius_m);
}

void RunStore::keep_views_in(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) throw InputError(folder.string() + ": can't be made: " + error.message());
  views_folder_ = folder;
}

std::filesystem::path views_folder(const std::filesystem::path& folder, const StoreSettings::Object& object,
                                   std::uint64_t seed, double view_radius_m) {
  const std::string radius = view_radius_m == StoreSettings().view_radius_m ? "" : fmt::format("-r{}", view_radius_m);
  return folder / fmt::format("{}-{}{}-seed{}", object.name, object.digest, radius, seed);
}

std::filesystem::path RunStore::file_of(const RunKey& key) const {
  return folder_ / "runs" / fmt::format("{}.{}.{}.csv", key.object, key.method, key.seed);
}

bool RunStore::holds(const RunKey& key) const { return std::filesystem::exists(file_of(key)); }

void RunStore::write(const MethodRun& run) const {
  AtomicFile file(file_of({run.object, run.method, run.seed}));
  file.stream() << kRunColumns << '\n';
  for (const MethodStep& s : run.steps) {
    file.stream() << fmt::format("{},{},{},{},{},{},{},{},{},{}\n", s.step, s.view_id, s.coverage, s.entropy_nats,
                                 s.motion_m, s.choose_s, s.load_s, s.integrate_s, s.measure_s, run.reachable);
  }
  file.commit();
}

std::vector<MethodRun> RunStore::read() const {
  std::vector<MethodRun> runs;
  for (const auto& entry : std::filesystem::directory_iterator(folder_ / "runs")) {
    if (entry.path().extension() == ".csv") runs.push_back(read_run(entry.path()));
  }
  const auto place = [&](const MethodRun& run) {
    const auto object = std::find_if(settings_.objects.begin(), settings_.objects.end(),
                                     [&](const StoreSettings::Object& other) { return other.name == run.object; });
    const auto method = std::find(method_names().begin(), method_names().end(), run.method);
    return std::make_tuple(object - settings_.objects.begin(), method - method_names().begin(), run.seed);
  };
  std::sort(runs.begin(), runs.end(), [&](const MethodRun& a, const MethodRun& b) { return place(a) < place(b); });
  return runs;
}

RunStore merge_stores(const std::vector<std::filesystem::path>& folders, const std::filesystem::path& out,
                      StoreStart start) {
  if (folders.empty()) throw InputError("merge: names no folder");
  StoreSettings settings = RunStore(folders.front()).settings();
  std::vector<MethodRun> merged;
  for (const std::filesystem::path& folder : folders) {
    const RunStore store(folder);
    add_settings(folder.string(), store.settings(), &settings);
    for (MethodRun& run : store.read()) {
      const auto same = std::find_if(merged.begin(), merged.end(), [&](const MethodRun& other) {
        return other.object == run.object && other.method == run.method && other.seed == run.seed;
      });
      if (same == merged.end()) {
        merged.push_back(std::move(run));
      } else if (!same_steps(*same, run)) {
        throw InputError(fmt::format("{}: its run of {} on {} with seed {} differs from another folder's",
                                     folder.string(), run.method, run.object, run.seed));
      }
    }
  }
  RunStore store(out, settings, start);
  for (const MethodRun& run : merged) store.write(run);
  return store;
}

double relative_motion(const MethodRun& run, const std::vector<MethodRun>& all) {
  double largest = 0;
  for (const MethodRun& other : all) {
    if (other.object == run.object && other.seed == run.seed) {
      largest = std::max(largest, other.steps.back().motion_m);
    }
  }
  return largest == 0 ? 0 : run.steps.back().motion_m / largest;
}

void write_tables(const std::filesystem::path& folder, const std::vector<MethodRun>& runs) {
  AtomicFile steps(folder / "steps.csv"), timing(folder / "timing.csv"), summary(folder / "summary.csv");
  steps.stream() << "object,method,seed,step,view_id,coverage,entropy_nats,motion_m\n";
  timing.stream() << "object,method,seed,step,choose_s,load_s,integrate_s,measure_s\n";
  summary.stream() << "object,method,seed,area_2_12,coverage_final,reachable,entropy_final,motion,seconds\n";
  for (const MethodRun& run : runs) {
    const std::string key = fmt::format("{},{},{}", run.object, run.method, run.seed);
    double seconds = 0;
    for (const MethodStep& s : run.steps) {
      steps.stream() << fmt::format("{},{},{},{},{},{}\n", key, s.step, s.view_id, s.coverage, s.entropy_nats,
                                    s.motion_m);
      timing.stream() << fmt::format("{},{},{:.4f},{:.4f},{:.4f},{:.4f}\n", key, s.step, s.choose_s, s.load_s,
                                     s.integrate_s, s.measure_s);
      seconds += s.choose_s + s.load_s + s.integrate_s + s.measure_s;
    }
    const MethodStep& last = run.steps.back();
    summary.stream() << fmt::format("{},{},{},{},{},{},{:.3f}\n", key, area_2_12(run), last.coverage, run.reachable,
                                    last.entropy_nats, relative_motion(run, runs), seconds);
  }
  steps.commit();
  timing.commit();
  summary.commit();
}

}  // namespace vantage
