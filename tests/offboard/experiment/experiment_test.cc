// One small scene for all: a box, seen from six of the paper's views.
#include "offboard/experiment/experiment.h"

#include <algorithm>
#include <atomic>
#include <memory>
#include <set>
#include <string>
#include <utility>

#include <gtest/gtest.h>
#include <unistd.h>

#include "calib/files/input_error.h"
#include "offboard/gain/view_gain.h"
#include "offboard/lookahead/view_set_planner.h"
#include "offboard/planning/planner.h"
#include "offboard/session/session_config.h"
#include "offboard/session/surface_coverage.h"
#include "tests/offboard/experiment/box_scene.h"

namespace vantage {
namespace {

constexpr std::uint64_t kSeed = 1;
const std::atomic<bool> kNeverStop = false;

class BoxScene : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    object_ = new ExperimentObject(box_object());
    folder_ = new std::filesystem::path(testing::TempDir() + "box_views-" + std::to_string(::getpid()));
    std::filesystem::remove_all(*folder_);
    scene_ = new SceneViews(*object_, six_views(), kSeed, *folder_);
    ASSERT_TRUE(scene_->prepare(2, kNeverStop, [](int, int) {}));
    truth_ = new SceneTruth(*measure_scene(*scene_, options(), kNeverStop));
  }
  static void TearDownTestSuite() {
    std::filesystem::remove_all(*folder_);
    delete truth_;
    delete scene_;
    delete folder_;
    delete object_;
  }
  static ExperimentOptions options() {
    ExperimentOptions options;
    options.views = 6;
    options.truth_points = 4000;
    options.choosing.known_share = 0;  // view_set_known takes all views, as the others do
    options.choosing.learned =
        std::make_shared<const LearnedWeights>(CombinedWeights::robot(), std::vector<LearnedWeights::Object>());
    return options;
  }
  static MethodRun run(const std::string& method, const ExperimentOptions& with = options()) {
    return *run_method(*scene_, *truth_, method, with, kNeverStop);
  }
  /// Views of a method's run.
  static std::vector<std::int64_t> ran(const std::string& method, const ExperimentOptions& with = options()) {
    std::vector<std::int64_t> views;
    for (const MethodStep& step : run(method, with).steps) views.push_back(step.view_id);
    return views;
  }
  /// Views to which a session's planner goes.
  static std::vector<std::int64_t> planned(std::unique_ptr<ViewChooser> chooser, double known_share = 0) {
    const SessionConfig session;
    Volume volume(session.region, session.sensor);
    Planner planner(volume, six_views(), std::move(chooser),
                    {.first_view = 0, .most_views = 6, .enough = {.share = known_share}});
    std::vector<std::int64_t> views;
    while (planner.goal()) {
      views.push_back(planner.goal()->id);
      std::string why;
      EXPECT_TRUE(planner.take(scene_->depth_map(static_cast<std::size_t>(planner.goal()->id)), &why)) << why;
    }
    return views;
  }

  static inline ExperimentObject* object_ = nullptr;
  static inline std::filesystem::path* folder_ = nullptr;
  static inline SceneViews* scene_ = nullptr;
  static inline SceneTruth* truth_ = nullptr;
};

TEST_F(BoxScene, ADepthMapFromTheCacheIsTheOneThatWasMade) {
  SceneViews again(*object_, six_views(), kSeed, *folder_), without(*object_, six_views(), kSeed, {});
  ASSERT_TRUE(again.prepare(1, kNeverStop, [](int, int) { FAIL() << "a view was made twice"; }));
  ASSERT_TRUE(without.prepare(1, kNeverStop, [](int, int) {}));
  for (std::size_t i = 0; i < scene_->candidates().size(); ++i) {
    for (const SceneViews* other : {&again, &without}) {
      EXPECT_EQ(scene_->depth_map(i).depth_m, other->depth_map(i).depth_m);
      EXPECT_EQ(scene_->depth_map(i).sigma_m, other->depth_map(i).sigma_m);
      EXPECT_EQ(scene_->depth_map(i).state, other->depth_map(i).state);
    }
  }
}

TEST_F(BoxScene, ADamagedFileOfTheCacheIsMadeAgain) {
  const std::filesystem::path file = *folder_ / "view-002.depth";
  const auto whole = std::filesystem::file_size(file);
  std::filesystem::resize_file(file, whole / 2);
  SceneViews again(*object_, six_views(), kSeed, *folder_);
  int made = 0;
  ASSERT_TRUE(again.prepare(2, kNeverStop, [&](int, int missing) { made = missing; }));
  EXPECT_EQ(made, 1);
  EXPECT_EQ(std::filesystem::file_size(file), whole);
}

TEST_F(BoxScene, EveryMethodEndsAtTheReachableCoverageAfterAllViews) {
  // The cloud keeps the first point of each 2 mm cell, so the order of views moves the share a little.
  for (const std::string& method : method_names()) {
    const MethodRun made = run(method);
    ASSERT_EQ(made.steps.size(), 6U) << method;
    EXPECT_NEAR(made.steps.back().coverage, truth_->reachable, 0.004) << method;
    std::set<std::int64_t> visited;
    double before = 0;
    for (const MethodStep& step : made.steps) {
      visited.insert(step.view_id);
      EXPECT_GE(step.coverage, before) << method;
      before = step.coverage;
    }
    EXPECT_EQ(visited.size(), 6U) << method;
    EXPECT_EQ(made.steps.front().view_id, 0) << "seed 1 starts at view 0";
  }
}

TEST_F(BoxScene, CoverageOfABoxIsWhatItsSeenFacesHold) {
  // Six views at two azimuths see all but two sides and the bottom at best: 4 sides of 0.048, lid and bottom of 0.04
  // m2.
  const double surface = 4 * 0.2 * 0.24 + 2 * 0.04;
  EXPECT_LT(truth_->reachable, (surface - 0.04) / surface);
  EXPECT_GT(truth_->reachable, (0.2 * 0.24 + 0.04) / surface * 0.9);
}

TEST_F(BoxScene, MotionIsThePolygonThroughTheViews) {
  const MethodRun made = run("random");
  double length = 0;
  for (std::size_t i = 1; i < made.steps.size(); ++i) {
    const auto at = [&](std::size_t step) {
      return six_views()[static_cast<std::size_t>(made.steps[step].view_id)].T_world_camera.translation();
    };
    length += (at(i) - at(i - 1)).norm();
    EXPECT_NEAR(made.steps[i].motion_m, length, 1e-12);
  }
}

TEST_F(BoxScene, AFormulationsRunIsThePlannersOfTheSession) {
  for (const Formulation formulation : {Formulation::kOcclusionAware, Formulation::kCombined}) {
    EXPECT_EQ(ran(std::string(name_of(formulation))),
              planned(std::make_unique<UtilityChooser>(gain_of(formulation, 80, 60))));
  }
}

TEST_F(BoxScene, AViewSetsRunIsThePlannersOfTheSession) {
  EXPECT_EQ(ran("view_set"), planned(std::make_unique<ViewSetPlanner>()));
}

TEST_F(BoxScene, AViewSetsRunEndsWhereTheSessionsPlannerFindsTheObjectKnown) {
  const auto views_taken = [](double known_share) {
    std::vector<std::int64_t> views = planned(std::make_unique<ViewSetPlanner>(), known_share);
    const std::size_t taken = views.size();
    views.resize(6, views.back());  // the experiment's camera stays
    ExperimentOptions with = options();
    with.choosing.known_share = known_share;
    EXPECT_EQ(ran("view_set_known", with), views) << known_share;
    EXPECT_EQ(ran("view_set", with), ran("view_set")) << "it goes on";
    return taken;
  };
  EXPECT_EQ(views_taken(0), 6U);
  EXPECT_EQ(views_taken(1), 2U) << "less than at first";
  const std::size_t some = views_taken(0.05);
  EXPECT_GT(some, 2U);
  EXPECT_LT(some, 6U);
}

TEST_F(BoxScene, WithoutCostAFormulationGoesToTheLargestGain) {
  ExperimentOptions by_gain = options();
  by_gain.choosing.cost_weight = 0;
  const MethodRun made = run("occlusion_aware", by_gain);
  const SessionConfig session;
  Volume volume(session.region, session.sensor);
  const DepthMap first = scene_->depth_map(0);
  ASSERT_TRUE(volume.integrate(first).ok);
  std::vector<Eigen::Isometry3d> poses;
  for (const CandidateView& view : six_views()) poses.push_back(view.T_world_camera);
  const std::vector<ViewGain> gains = evaluate_views(volume.map(), RayBundle(first.camera, 80, 60), poses);
  std::size_t best = 1;
  for (std::size_t i = 2; i < gains.size(); ++i) {
    if (gains[i][Formulation::kOcclusionAware] > gains[best][Formulation::kOcclusionAware]) best = i;
  }
  EXPECT_EQ(made.steps[1].view_id, static_cast<std::int64_t>(best));
}

TEST_F(BoxScene, TheNearestObjectsWeightsAreChosenByTheFirstView) {
  CombinedWeights entropy;
  entropy.weight.fill(0);
  entropy[Formulation::kEntropy] = 1;
  const SessionConfig session;
  Volume volume(session.region, session.sensor);
  ASSERT_TRUE(volume.integrate(scene_->depth_map(0)).ok);
  const ShapeDescriptor like = describe_shape(volume.map());
  ShapeDescriptor unlike = like;
  for (double& value : unlike.value) value += 1;
  ExperimentOptions nearest = options(), whole = options();
  nearest.choosing.learned = std::make_shared<const LearnedWeights>(
      CombinedWeights::robot(),
      std::vector<LearnedWeights::Object>{{"other", CombinedWeights(), {unlike}}, {"like", entropy, {like}}});
  whole.choosing.learned = std::make_shared<const LearnedWeights>(entropy, std::vector<LearnedWeights::Object>());
  EXPECT_EQ(ran("combined_nearest", nearest), ran("combined_learned", whole));
}

TEST_F(BoxScene, ClampingReachesTheMap) {
  // A clamp nearer to certainty leaves less entropy in voxels that were seen often.
  ExperimentOptions wide = options(), narrow = options();
  wide.clamp_min = 0.01;
  wide.clamp_max = 0.99;
  narrow.clamp_min = 0.12;
  const auto entropy = [&](const ExperimentOptions& with) { return run("sequential", with).steps.back().entropy_nats; };
  EXPECT_LT(entropy(wide), entropy(options()));
  EXPECT_LT(entropy(options()), entropy(narrow));
}

TEST_F(BoxScene, ARunStaysWhereItsWayEnds) {
  ExperimentOptions limited = options();
  const std::vector<MethodStep> whole = run("sequential").steps;
  limited.most_way_m = whole[2].motion_m + 1e-6;
  for (const char* method : {"sequential", "view_set", "rear_side_entropy"}) {
    const std::vector<MethodStep> steps = run(method, limited).steps;
    ASSERT_EQ(steps.size(), whole.size()) << method;
    EXPECT_LE(steps.back().motion_m, limited.most_way_m) << method;
    EXPECT_EQ(steps.back().step, whole.back().step) << method;
  }
  const std::vector<MethodStep> steps = run("sequential", limited).steps;
  EXPECT_EQ(steps[2].view_id, whole[2].view_id);
  EXPECT_EQ(steps.back().view_id, whole[2].view_id);
  EXPECT_EQ(steps.back().coverage, whole[2].coverage);
}

TEST(Candidates, StandAtTheRadius) {
  ExperimentOptions near;
  near.view_radius_m = 0.5;
  const std::vector<CandidateView> views = candidates_of(near);
  ASSERT_EQ(views.size(), 48U);
  EXPECT_NEAR(views[3].T_world_camera.translation().head<2>().norm(), 0.5, 1e-12);
  EXPECT_NEAR(candidates_of({})[3].T_world_camera.translation().head<2>().norm(), 0.6, 1e-12);
}

TEST_F(BoxScene, TheOraclesSecondViewCoversMost) {
  std::vector<double> after_two;
  for (std::size_t second = 1; second < 6; ++second) {
    const SessionConfig session;
    SurfaceCloud cloud(session.region, session.cloud);
    SurfaceCoverage coverage(truth_->surface);
    coverage.add(cloud.add(scene_->depth_map(0)));
    coverage.add(cloud.add(scene_->depth_map(second)));
    after_two.push_back(coverage.share());
  }
  EXPECT_NEAR(run("oracle").steps[1].coverage, *std::max_element(after_two.begin(), after_two.end()), 0.004);
}

TEST_F(BoxScene, AStoppedRunLeavesNothing) {
  const std::atomic<bool> stop = true;
  EXPECT_FALSE(run_method(*scene_, *truth_, "sequential", options(), stop));
  EXPECT_FALSE(measure_scene(*scene_, options(), stop));
}

TEST(Area, IsTheMeanCoverageOfViews2To12) {
  MethodRun run;
  for (std::int64_t i = 1; i <= 20; ++i) {
    MethodStep step;
    step.step = i;
    step.coverage = static_cast<double>(i) / 100;
    run.steps.push_back(step);
  }
  EXPECT_NEAR(area_2_12(run), 0.07, 1e-12);  // the mean of 2 to 12 is 7
  run.steps.resize(1);
  EXPECT_EQ(area_2_12(run), 0);
}

TEST(Shards, TogetherHoldEachRunOnce) {
  std::vector<ExperimentObject> objects{box_object()};
  const std::vector<RunKey> all = list_runs(objects, {"random", "sequential", "oracle"}, 7);
  ASSERT_EQ(all.size(), 21U);
  for (int count = 1; count <= 25; ++count) {
    std::vector<RunKey> together;
    for (int i = 1; i <= count; ++i) {
      const std::vector<RunKey> part = shard_of(all, {i, count});
      together.insert(together.end(), part.begin(), part.end());
      EXPECT_LE(part.size(), all.size() / static_cast<std::size_t>(count) + 1);
    }
    EXPECT_EQ(together, all) << count << " shards";
  }
}

TEST(Shards, AreGivenAsIOfN) {
  EXPECT_EQ(Shard::parse("2/8").index, 2);
  EXPECT_EQ(Shard::parse("2/8").count, 8);
  for (const char* wrong : {"", "0/3", "4/3", "2", "2/", "/2", "2/3x", "a/b", "-1/3", "1/0"}) {
    EXPECT_THROW(Shard::parse(wrong), InputError) << wrong;
  }
}

}  // namespace
}  // namespace vantage
