#include "offboard/experiment/run_store.h"

#include <fstream>
#include <iterator>
#include <string>

#include <gtest/gtest.h>
#include <unistd.h>

#include "calib/files/input_error.h"

namespace vantage {
namespace {

MethodRun made_run(const std::string& method, std::uint64_t seed, double motion_m) {
  MethodRun run{"box", method, seed, 0.9, {}};
  for (std::int64_t i = 1; i <= 3; ++i) {
    MethodStep step;
    step.step = i;
    step.view_id = 10 * i;
    step.coverage = 0.1 * static_cast<double>(i);
    step.entropy_nats = 1e6 / static_cast<double>(3 * i);
    step.motion_m = motion_m * static_cast<double>(i - 1) / 2;
    step.choose_s = 0.5;
    run.steps.push_back(step);
  }
  return run;
}

StoreSettings settings_of(int views, std::vector<StoreSettings::Object> objects) {
  StoreSettings settings;
  settings.views = views;
  settings.objects = std::move(objects);
  return settings;
}

std::string text_of(const std::filesystem::path& file) {
  std::ifstream stream(file);
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

class Store : public testing::Test {
 protected:
  void SetUp() override { std::filesystem::remove_all(root_); }
  void TearDown() override { std::filesystem::remove_all(root_); }

  std::filesystem::path root_ =
      std::filesystem::path(testing::TempDir()) / ("run_store_test-" + std::to_string(::getpid()));
  StoreSettings settings_ = settings_of(3, {{"box", "0123"}});
};

TEST_F(Store, SummaryHoldsWhatAHandCalculationGives) {
  std::filesystem::create_directories(root_);
  const RunStore store(root_ / "a", settings_, StoreStart::kNew);
  store.write(made_run("random", 1, 4));
  store.write(made_run("oracle", 1, 2));
  write_tables(root_ / "a", store.read());
  EXPECT_EQ(text_of(root_ / "a/summary.csv"),
            "object,method,seed,area_2_12,coverage_final,reachable,entropy_final,motion,seconds\n"
            "box,random,1,0.25,0.30000000000000004,0.9,111111.11111111111,1,1.500\n"
            "box,oracle,1,0.25,0.30000000000000004,0.9,111111.11111111111,0.5,1.500\n");
}

TEST_F(Store, ARunComesBackToTheBit) {
  const RunStore store(root_, settings_, StoreStart::kNew);
  const MethodRun run = made_run("view_set", 77, 1.0 / 3);
  EXPECT_FALSE(store.holds({"box", "view_set", 77}));
  store.write(run);
  EXPECT_TRUE(store.holds({"box", "view_set", 77}));
  const std::vector<MethodRun> read = RunStore(root_).read();
  ASSERT_EQ(read.size(), 1U);
  EXPECT_EQ(read[0].steps[2].entropy_nats, run.steps[2].entropy_nats);
  EXPECT_EQ(read[0].steps[2].motion_m, run.steps[2].motion_m);
  EXPECT_EQ(read[0].seed, 77U);
}

TEST_F(Store, AStartedFolderIsNotWrittenOverUnasked) {
  { RunStore(root_, settings_, StoreStart::kNew).write(made_run("random", 1, 1)); }
  EXPECT_THROW(RunStore(root_, settings_, StoreStart::kNew), InputError);
  EXPECT_TRUE(RunStore(root_, settings_, StoreStart::kResume).holds({"box", "random", 1}));
  EXPECT_FALSE(RunStore(root_, settings_, StoreStart::kOverwrite).holds({"box", "random", 1}));
}

TEST_F(Store, SettingsOfAnOlderVersionAreItsDefaults) {
  std::filesystem::create_directories(root_ / "runs");
  std::ofstream(root_ / "settings.txt") << "vantage-experiment 1\nviews 3\ncost_weight 1\nobject box 0123\n";
  const RunStore store(root_, settings_, StoreStart::kResume);
  EXPECT_EQ(store.settings().ray_columns, 80);
  EXPECT_EQ(store.settings().view_radius_m, 0.6);
  EXPECT_EQ(store.settings().weights, "none");
}

TEST_F(Store, ViewsOfOneCacheDifferByRadius) {
  RunStore store(root_, settings_, StoreStart::kNew);
  const std::filesystem::path own = store.views_of("box", 1);
  EXPECT_EQ(own, root_ / "views" / "box-0123-seed1");
  store.keep_views_in(root_ / "cache");
  EXPECT_EQ(store.views_of("box", 1), root_ / "cache" / "box-0123-seed1");
  EXPECT_NE(views_folder("c", {"box", "0123"}, 1, 0.5), views_folder("c", {"box", "0123"}, 1, 0.6));
}

TEST_F(Store, AFolderWithOtherFilesIsLeftAlone) {
  std::filesystem::create_directories(root_);
  std::ofstream(root_ / "thesis.tex") << "x";
  EXPECT_THROW(RunStore(root_, settings_, StoreStart::kOverwrite), InputError);
  EXPECT_TRUE(std::filesystem::exists(root_ / "thesis.tex"));
}

TEST_F(Store, RunsMadeOtherwiseAreNotPutBesideEachOther) {
  { const RunStore store(root_, settings_, StoreStart::kNew); }
  const std::vector<StoreSettings::Object> box{{"box", "0123"}};
  std::vector<StoreSettings> others = {settings_of(4, box), settings_of(3, {{"box", "4567"}})};
  for (int i = 0; i < 8; ++i) others.push_back(settings_of(3, box));
  others[2].cost_weight = 0;
  others[3].ray_columns = 160;
  others[4].clamp_min = 0.12;
  others[5].clamp_max = 0.99;
  others[6].view_radius_m = 0.5;
  others[7].weights = "89ab";
  others[8].most_way_m = 5;
  others[9].known_share = 0.01;
  for (const StoreSettings& other : others) EXPECT_THROW(RunStore(root_, other, StoreStart::kResume), InputError);
  EXPECT_EQ(RunStore(root_, settings_of(3, {{"ball", "89"}}), StoreStart::kResume).settings().objects.size(), 2U);
}

TEST_F(Store, AHalfWrittenRunIsNone) {
  const RunStore store(root_, settings_, StoreStart::kNew);
  std::ofstream(root_ / "runs/box.random.1.csv.tmp-4711") << "step,view_id,cov";
  EXPECT_FALSE(store.holds({"box", "random", 1}));
  EXPECT_TRUE(store.read().empty());
}

TEST_F(Store, MergeLosesNothingAndDoublesNothing) {
  std::filesystem::create_directories(root_);
  const RunStore a(root_ / "a", settings_, StoreStart::kNew), b(root_ / "b", settings_, StoreStart::kNew),
      whole(root_ / "whole", settings_, StoreStart::kNew);
  for (const RunStore* store : {&a, &whole}) {
    store->write(made_run("random", 1, 1));
    store->write(made_run("random", 2, 2));
  }
  MethodRun again = made_run("random", 2, 2);
  again.steps[1].choose_s = 0.75;  // another machine's time, the same run
  b.write(again);
  for (const RunStore* store : {&b, &whole}) store->write(made_run("oracle", 2, 3));
  const RunStore merged = merge_stores({root_ / "a", root_ / "b"}, root_ / "out", StoreStart::kNew);
  write_tables(root_ / "out", merged.read());
  write_tables(root_ / "whole", whole.read());
  for (const char* table : {"steps.csv", "summary.csv", "timing.csv"}) {
    EXPECT_EQ(text_of(root_ / "out" / table), text_of(root_ / "whole" / table));
  }
}

TEST_F(Store, MergeRefusesRunsThatContradict) {
  std::filesystem::create_directories(root_);
  const RunStore a(root_ / "a", settings_, StoreStart::kNew), b(root_ / "b", settings_, StoreStart::kNew);
  a.write(made_run("random", 1, 1));
  b.write(made_run("random", 1, 1.5));
  EXPECT_THROW(merge_stores({root_ / "a", root_ / "b"}, root_ / "out", StoreStart::kNew), InputError);
  EXPECT_THROW(merge_stores({root_ / "a", root_ / "nowhere"}, root_ / "out", StoreStart::kNew), InputError);
}

}  // namespace
}  // namespace vantage
