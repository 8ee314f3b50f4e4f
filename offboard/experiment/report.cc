#include "offboard/experiment/report.h"

#include <algorithm>
#include <array>

#include <fmt/format.h>

#include "calib/files/atomic_file.h"
#include "calib/files/input_error.h"
#include "offboard/experiment/statements.h"
#include "offboard/experiment/svg_plot.h"

namespace vantage {
namespace {

struct Pen {
  const char* colour;
  double width;
  bool dashed;
};

/// By place in method_names(): the paper's in colours, what they are measured by in grey and black, ours bold.
constexpr std::array<Pen, 15> kPens = {{{"#1f77b4", 1.5, false},
                                        {"#17becf", 1.5, false},
                                        {"#2ca02c", 1.5, false},
                                        {"#9acd32", 1.5, false},
                                        {"#ff7f0e", 1.5, false},
                                        {"#9467bd", 1.5, false},
                                        {"#8c564b", 1.5, false},
                                        {"#e377c2", 1.5, false},
                                        {"#888888", 1.5, true},
                                        {"#bbbbbb", 1.5, true},
                                        {"#000000", 1.8, true},
                                        {"#d62728", 3.0, false},
                                        {"#d62728", 2.0, true},
                                        {"#4b2e83", 2.0, true},
                                        {"#b39ddb", 2.0, true}}};

struct Measure {
  const char* name;  // of the file
  const char* title;
  const char* axis;
  double MethodStep::*value;
};
constexpr std::array<Measure, 3> kMeasures = {
    {{"coverage", "surface coverage (8 mm)", "share of the true surface", &MethodStep::coverage},
     {"entropy", "entropy of the map", "nats", &MethodStep::entropy_nats},
     {"motion", "motion", "over the longest way of any method", &MethodStep::motion_m}}};

/// The mean over seeds of one method's runs, as far as all of them go.
PlotCurve curve_of(const std::vector<const MethodRun*>& runs, double MethodStep::*value, double scale) {
  PlotCurve curve;
  std::size_t steps = runs.front()->steps.size();
  for (const MethodRun* run : runs) steps = std::min(steps, run->steps.size());
  for (std::size_t i = 0; i < steps; ++i) {
    double sum = 0, low = runs.front()->steps[i].*value, high = low;
    for (const MethodRun* run : runs) {
      const double y = run->steps[i].*value;
      sum += y;
      low = std::min(low, y);
      high = std::max(high, y);
    }
    curve.x.push_back(static_cast<double>(i + 1));
    curve.mean.push_back(scale * sum / static_cast<double>(runs.size()));
    curve.low.push_back(scale * low);
    curve.high.push_back(scale * high);
  }
  return curve;
}

Plot plot_of(const std::vector<MethodRun>& runs, const std::string& object, const Measure& measure) {
  Plot plot{object + ": " + measure.title, "views", measure.axis, {}};
  double scale = 1, reachable = 0;
  int count = 0;
  if (measure.value == &MethodStep::motion_m) {
    double longest = 0;
    for (const MethodRun& run : runs) {
      if (run.object == object) longest = std::max(longest, run.steps.back().motion_m);
    }
    if (longest > 0) scale = 1 / longest;
  }
  for (std::size_t m = 0; m < method_names().size(); ++m) {
    std::vector<const MethodRun*> of_method;
    for (const MethodRun& run : runs) {
      if (run.object != object || run.method != method_names()[m]) continue;
      of_method.push_back(&run);
      reachable += run.reachable;
      ++count;
    }
    if (of_method.empty()) continue;
    PlotCurve curve = curve_of(of_method, measure.value, scale);
    curve.name = method_names()[m];
    const Pen& pen = kPens.at(m);
    curve.colour = pen.colour;
    curve.width = pen.width;
    curve.dashed = pen.dashed;
    plot.curves.push_back(std::move(curve));
  }
  if (measure.value == &MethodStep::coverage && count > 0 && !plot.curves.empty()) {
    const std::vector<double>& x = plot.curves.front().x;
    const std::vector<double> level(2, reachable / count);
    plot.curves.push_back({"reachable (all views)", "#444444", 1, true, {x.front(), x.back()}, level, level, level});
  }
  return plot;
}

std::string verdict_list(const std::vector<Verdict>& verdicts) {
  std::string html = "<ul class=\"verdicts\">\n";
  for (const Verdict& verdict : verdicts) {
    html += fmt::format("<li class=\"{}\"><b>{}</b> {}: {} &mdash; {}</li>\n", verdict.holds ? "yes" : "no",
                        verdict.holds ? "holds" : "does not hold", escaped(verdict.object), escaped(verdict.statement),
                        escaped(verdict.by_how_much));
  }
  return html + "</ul>\n";
}

/// What was found to move the orderings, with `run`'s options to see it; figures and tables in docs/experiment.md.
constexpr const char* kCauses =
    "<h3>What moves the orderings</h3>\n<ul>\n"
    "<li>The cost term of Eq. 11 decides where a gain is alike for all views: then the nearest view wins. Without it "
    "(<code>--cost-weight 0</code>) occlusion_aware leads in coverage.</li>\n"
    "<li>combined adds a mean over voxels (average_entropy) to a sum over rays (rear_side_entropy), so its weights "
    "mean "
    "something only with a ray count: second with 80 x 60 and more, fifth with 40 x 30 (<code>--rays</code>), where "
    "the mean outweighs the sum. Clamping at 0.12 (<code>--clamp 0.12,0.97</code>) does the same, by the entropy that "
    "it "
    "leaves in free space.</li>\n"
    "<li>proximity_count draws level with rear_side_entropy when views stand nearer or farther "
    "(<code>--view-radius</code> 0.5 or 0.8): its marks reach a fixed 0.3 m.</li>\n"
    "<li>rear_side_voxel falls by 0.04 to 0.07 with few rays or another radius.</li>\n"
    "<li>None of these rays, clamps and radii makes one of the paper's four statements hold on one of its "
    "objects.</li>\n"
    "</ul>\n";

/// "0.845 ± 0.012": the mean and its interval at 95 %, where there is one.
std::string with_interval(const MeanInterval& interval, int digits) {
  std::string text = fmt::format("{:.{}f}", interval.mean, digits);
  if (interval.half_width) text += fmt::format(" &plusmn; {:.{}f}", *interval.half_width, digits);
  return text;
}

std::string means_table(const std::vector<MethodRun>& runs, const std::string& object) {
  std::string html =
      "<table><tr><th>method</th><th>area, views 2&ndash;12</th><th>least &ndash; largest</th><th>coverage at the "
      "end</th>"
      "<th>mean entropy, views 2&ndash;12 (nats)</th><th>way (m)</th><th>seeds</th></tr>\n";
  std::vector<MethodMeans> means = means_of(runs, object);
  std::stable_sort(means.begin(), means.end(),
                   [](const MethodMeans& a, const MethodMeans& b) { return a.area_2_12 > b.area_2_12; });
  for (const MethodMeans& m : means) {
    html += fmt::format(
        "<tr><td>{}</td><td>{}</td><td>{:.3f} &ndash; {:.3f}</td><td>{}</td><td>{:.0f}</td><td>{}</td>"
        "<td>{}</td></tr>\n",
        escaped(m.method), with_interval(m.area_interval, 3), m.area_interval.least, m.area_interval.largest,
        with_interval(m.coverage_interval, 3), m.entropy_2_12, with_interval(m.motion_interval, 2), m.seeds);
  }
  return html + "</table>\n";
}

constexpr const char* kHead =
    "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>vantage-experiment</title>\n<style>\n"
    "body{font:15px/1.45 sans-serif;max-width:1560px;margin:24px auto;padding:0 16px;color:#222}\n"
    "table{border-collapse:collapse;margin:8px 0 16px}td,th{padding:3px 12px;border-bottom:1px solid #ddd;"
    "text-align:right}\ntd:first-child,th:first-child{text-align:left}\n"
    ".plots{display:flex;flex-wrap:wrap;gap:8px}.verdicts{list-style:none;padding:0}.verdicts li{padding:2px 0}\n"
    ".yes b{color:#187a2f}.no b{color:#b3261e}\n</style></head><body>\n";

void write_means(const std::filesystem::path& folder, const std::vector<MethodRun>& runs,
                 const std::vector<std::string>& objects) {
  AtomicFile file(folder / "means.csv");
  file.stream() << "object,method,seeds,area_2_12,area_ci95,area_least,area_largest,coverage_final,coverage_ci95,"
                   "motion_m,motion_ci95,reachable\n";
  const auto half = [](const MeanInterval& interval) {
    return interval.half_width ? fmt::format("{}", *interval.half_width) : std::string();
  };
  for (const std::string& object : objects) {
    for (const MethodMeans& m : means_of(runs, object)) {
      file.stream() << fmt::format("{},{},{},{},{},{},{},{},{},{},{},{}\n", object, m.method, m.seeds, m.area_2_12,
                                   half(m.area_interval), m.area_interval.least, m.area_interval.largest,
                                   m.coverage_final, half(m.coverage_interval), m.motion_m, half(m.motion_interval),
                                   m.reachable);
    }
  }
  file.commit();
}

}  // namespace

void write_report(const RunStore& store, const std::vector<MethodRun>& runs) {
  std::error_code error;
  std::filesystem::create_directories(store.folder() / "plots", error);
  if (error) throw InputError((store.folder() / "plots").string() + ": can't be made: " + error.message());
  std::vector<std::string> objects;
  for (const StoreSettings::Object& object : store.settings().objects) {
    if (std::any_of(runs.begin(), runs.end(), [&](const MethodRun& run) { return run.object == object.name; })) {
      objects.push_back(object.name);
    }
  }
  const StoreSettings& settings = store.settings();
  write_means(store.folder(), runs, objects);
  std::string html = kHead;
  html += fmt::format(
      "<h1>Ways to choose the next view</h1>\n<p>{} runs of {} views, cost weight {}, {} x {} rays, clamped to [{}, "
      "{}], "
      "views at {} m{}. Curves are means over the seeds (noise, texture, first view); bands go from the least to the "
      "largest. &plusmn; is the confidence interval of the mean at 95 % (Student's t over the seeds).</p>\n",
      runs.size(), settings.views, settings.cost_weight, settings.ray_columns, settings.ray_rows, settings.clamp_min,
      settings.clamp_max, settings.view_radius_m,
      settings.most_way_m > 0 ? fmt::format(", a way of {} m at most", settings.most_way_m) : "");
  if (std::any_of(runs.begin(), runs.end(), [](const MethodRun& run) { return run.method == "view_set_known"; })) {
    html += fmt::format("<p>view_set_known ends when no view promises {} of what the best promised at first.</p>\n",
                        settings.known_share);
  }
  html += "<h2>Held against the paper's statements, and ours</h2>\n" + verdict_list(judge_statements(runs, objects));
  if (std::any_of(runs.begin(), runs.end(), [](const MethodRun& run) { return is_paper_method(run.method); })) {
    html += kCauses;
  }
  for (const std::string& object : objects) {
    html += "<h2>" + escaped(object) + "</h2>\n" + means_table(runs, object) + "<div class=\"plots\">\n";
    for (const Measure& measure : kMeasures) {
      const std::string svg = svg_of(plot_of(runs, object, measure));
      AtomicFile file(store.folder() / "plots" / fmt::format("{}-{}.svg", object, measure.name));
      file.stream() << svg;
      file.commit();
      html += svg;
    }
    html += "</div>\n";
  }
  html += "</body></html>\n";
  AtomicFile file(store.folder() / "report.html");
  file.stream() << html;
  file.commit();
}

}  // namespace vantage
