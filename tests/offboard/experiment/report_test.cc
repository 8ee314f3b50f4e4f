#include "offboard/experiment/report.h"

#include <fstream>
#include <iterator>
#include <string>

#include <gtest/gtest.h>
#include <unistd.h>

#include "offboard/experiment/statements.h"
#include "offboard/experiment/svg_plot.h"

namespace vantage {
namespace {

TEST(AxisTicks, AreRoundAndSpan) {
  EXPECT_EQ(axis_ticks(0, 10, 5), (std::vector<double>{0, 2, 4, 6, 8, 10}));
  EXPECT_EQ(axis_ticks(1, 20, 10).back(), 20);
  const std::vector<double> entropy = axis_ticks(796'000, 1'370'000, 8);
  EXPECT_EQ(entropy.front(), 700'000);
  EXPECT_EQ(entropy.back(), 1'400'000);
  EXPECT_GE(axis_ticks(3, 3, 8).size(), 2U);  // a level line has an axis too
}

TEST(Svg, HasALineACurveAndEscapesNames) {
  const PlotCurve curve{"a<b", "#123456", 1, false, {1, 2}, {0.5, 0.75}, {0.5, 0.5}, {0.5, 1}};
  const std::string svg = svg_of({"title", "x", "y", {curve}});
  EXPECT_NE(svg.find("a&lt;b"), std::string::npos);
  EXPECT_EQ(svg.find("a<b"), std::string::npos);
  EXPECT_EQ(svg.find("nan"), std::string::npos);
  EXPECT_EQ(svg.substr(0, 4), "<svg");
}

/// A run whose coverage is `coverage` at each of 12 views.
MethodRun level_run(const std::string& method, double coverage, double motion_m, std::uint64_t seed = 1) {
  MethodRun run{"box", method, seed, 0.95, {}};
  for (std::int64_t i = 1; i <= 12; ++i) {
    MethodStep step;
    step.step = i;
    step.coverage = coverage;
    step.entropy_nats = 1000 * (1 - coverage);
    step.motion_m = motion_m * static_cast<double>(i) / 12;
    run.steps.push_back(step);
  }
  return run;
}

/// The paper's outcome, to the letter.
std::vector<MethodRun> as_the_paper_says() {
  std::vector<MethodRun> runs = {level_run("occlusion_aware", 0.3, 1),  level_run("unobserved_voxel", 0.2, 2),
                                 level_run("rear_side_voxel", 0.9, 5),  level_run("rear_side_entropy", 0.7, 5),
                                 level_run("proximity_count", 0.85, 5), level_run("combined", 0.8, 5),
                                 level_run("average_entropy", 0.5, 4),  level_run("area_factor", 0.5, 4)};
  for (MethodStep& step : runs[6].steps) step.entropy_nats = 10;
  for (MethodStep& step : runs[7].steps) step.entropy_nats = 20;
  return runs;
}

TEST(Statements, HoldOnThePapersOutcomeAndFailOnTheContrary) {
  std::vector<MethodRun> runs = as_the_paper_says();
  std::vector<Verdict> verdicts = judge_statements(runs, {"box"});
  ASSERT_EQ(verdicts.size(), 4U);
  for (const Verdict& verdict : verdicts) EXPECT_TRUE(verdict.holds) << verdict.statement;
  runs[2] = level_run("rear_side_voxel", 0.6, 5);
  verdicts = judge_statements(runs, {"box"});
  EXPECT_FALSE(verdicts[0].holds);
  EXPECT_EQ(verdicts[0].by_how_much, "last of them rear_side_voxel 0.600, first of the others rear_side_entropy 0.700");
}

TEST(Statements, OfMethodsThatDidNotRunNothingIsSaid) {
  std::vector<MethodRun> runs = as_the_paper_says();
  runs.pop_back();
  EXPECT_TRUE(judge_statements(runs, {"box"}).empty());
}

TEST(Statements, ViewSetsAreHeldAgainstTheBestOneStepMethodAndTheOracle) {
  std::vector<MethodRun> runs = as_the_paper_says();
  runs.push_back(level_run("oracle", 0.94, 9));
  runs.push_back(level_run("view_set", 0.92, 5.5));
  runs.push_back(level_run("view_set_known", 0.905, 4.5));
  const std::vector<Verdict> verdicts = judge_statements(runs, {"box"});
  ASSERT_EQ(verdicts.size(), 8U);
  EXPECT_FALSE(verdicts[4].holds) << "it covers more, but moves 5.5 m where the best one-step method moves 5";
  EXPECT_TRUE(verdicts[5].holds);
  EXPECT_TRUE(verdicts[6].holds) << verdicts[6].by_how_much;
  EXPECT_FALSE(verdicts[7].holds) << verdicts[7].by_how_much;
}

TEST(Statements, LearnedWeightsAreHeldAgainstThePapersAndTheNearestAgainstThem) {
  const std::vector<MethodRun> runs = {level_run("combined", 0.7, 5), level_run("combined_learned", 0.8, 6),
                                       level_run("combined_nearest", 0.75, 6)};
  const std::vector<Verdict> verdicts = judge_statements(runs, {"box"});
  ASSERT_EQ(verdicts.size(), 2U);
  EXPECT_TRUE(verdicts[0].holds);
  EXPECT_FALSE(verdicts[1].holds);
}

TEST(Means, AreOverSeeds) {
  const std::vector<MethodMeans> means =
      means_of({level_run("random", 0.5, 2, 1), level_run("random", 0.7, 4, 2)}, "box");
  ASSERT_EQ(means.size(), 1U);
  EXPECT_NEAR(means[0].area_2_12, 0.6, 1e-12);
  EXPECT_NEAR(means[0].area_interval.least, 0.5, 1e-12);
  EXPECT_NEAR(means[0].area_interval.largest, 0.7, 1e-12);
  EXPECT_NEAR(means[0].motion_m, 3, 1e-12);
  // Two values that differ by 0.2: standard deviation 0.1414, over sqrt(2) 0.1, times 12.706.
  EXPECT_NEAR(means[0].area_interval.half_width.value(), 1.2706, 1e-3);
}

TEST(Report, NeedsNoOtherFile) {
  const std::filesystem::path folder =
      std::filesystem::path(testing::TempDir()) / ("report_test-" + std::to_string(::getpid()));
  std::filesystem::remove_all(folder);
  StoreSettings settings;
  settings.views = 12;
  settings.objects = {{"box", "00"}};
  const RunStore store(folder, settings, StoreStart::kNew);
  std::vector<MethodRun> runs;
  for (const std::string& method : method_names()) runs.push_back(level_run(method, 0.5, 3));
  write_report(store, runs);
  std::ifstream file(folder / "report.html");
  const std::string html{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  std::size_t plots = 0;
  for (std::size_t at = 0; (at = html.find("<svg", at)) != std::string::npos; ++at) ++plots;
  EXPECT_EQ(plots, 3U);
  for (const std::string& method : method_names()) EXPECT_NE(html.find(">" + method + "</text>"), std::string::npos);
  EXPECT_NE(html.find("view_set_known ends when no view promises 0.008 of what the best promised at first"),
            std::string::npos);
  for (const char* loads : {"src=", "href=", "url("}) EXPECT_EQ(html.find(loads), std::string::npos) << loads;
  for (const char* plot : {"coverage", "entropy", "motion"}) {
    EXPECT_TRUE(std::filesystem::exists(folder / "plots" / ("box-" + std::string(plot) + ".svg")));
  }
  std::ifstream means(folder / "means.csv");
  std::string line;
  std::getline(means, line);
  std::getline(means, line);
  EXPECT_EQ(line.substr(0, 23), "box,occlusion_aware,1,0");
  EXPECT_NE(line.find(",,"), std::string::npos) << "one seed has no interval";
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace vantage
