// On a box seen from six of the paper's views, of which a run visits four.
#include "offboard/experiment/weight_search.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include "tests/offboard/experiment/box_scene.h"

namespace vantage {
namespace {

constexpr std::uint64_t kSeed = 1;
const std::atomic<bool> kNeverStop = false;

class BoxSearch : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    object_ = new ExperimentObject(box_object());
    views_ = new SceneViews(*object_, six_views(), kSeed, {});
    ASSERT_TRUE(views_->prepare(2, kNeverStop, [](int, int) {}));
    truth_ = new SceneTruth(*measure_scene(*views_, options(), kNeverStop));
  }
  static void TearDownTestSuite() {
    delete truth_;
    delete views_;
    delete object_;
  }
  void SetUp() override { std::filesystem::remove(log_); }
  void TearDown() override { std::filesystem::remove(log_); }

  static ExperimentOptions options() {
    ExperimentOptions options;
    options.views = 4;
    options.truth_points = 4000;
    return options;
  }
  FoundWeights search(TuningScene* scene, int threads, const std::atomic<bool>& stop, int stop_after,
                      std::atomic<bool>* stop_setter, bool* whole) {
    EvaluationLog log(log_, "");
    const WeightCoordinates coordinates({scene});
    int paid = 0;
    const auto found =
        search_weights("box", {scene}, coordinates, coordinates.of_weights(CombinedWeights()),
                       {.evaluations = 31, .seed = 5, .threads = threads}, &log, stop, [&](const FoundWeights&) {
                         if (++paid == stop_after) *stop_setter = true;
                       });
    paid_ = paid;
    *whole = found.has_value();
    return found.value_or(FoundWeights{});
  }

  static inline ExperimentObject* object_ = nullptr;
  static inline SceneViews* views_ = nullptr;
  static inline SceneTruth* truth_ = nullptr;
  std::filesystem::path log_ =
      std::filesystem::path(testing::TempDir()) / ("weight_search_test-" + std::to_string(::getpid()));
  int paid_ = 0;
};

TEST_F(BoxSearch, TriesWeightsAsARunDoes) {
  TuningScene scene(*views_, *truth_, options());
  CombinedWeights other;
  other.weight.fill(0);
  other[Formulation::kOcclusionAware] = 1;
  for (const CombinedWeights& weights : {CombinedWeights(), other, CombinedWeights::robot(), CombinedWeights()}) {
    ExperimentOptions learned = options();
    learned.choosing.learned = std::make_shared<const LearnedWeights>(weights, std::vector<LearnedWeights::Object>());
    const MethodRun run = *run_method(*views_, *truth_, "combined_learned", learned, kNeverStop);
    std::vector<std::size_t> visited;
    for (const MethodStep& step : run.steps) visited.push_back(static_cast<std::size_t>(step.view_id));
    EXPECT_EQ(scene.visit(weights), visited);
    EXPECT_NEAR(scene.area(weights), area_2_12(run), 0.004);
  }
}

TEST_F(BoxSearch, CoordinatesKeepWhatMattersOfWeights) {
  TuningScene scene(*views_, *truth_, options());
  const WeightCoordinates coordinates({&scene});
  const CombinedWeights robot = CombinedWeights::robot();
  const Eigen::VectorXd x = coordinates.of_weights(robot);
  EXPECT_EQ(x.maxCoeff(), 0);
  EXPECT_GE(x.minCoeff(), WeightCoordinates::kLeast);
  const CombinedWeights back = coordinates.weights_of(x);
  // Eq. 11 divides by the sum of gains: only the ratio of weights matters.
  EXPECT_NEAR(back[Formulation::kUnobservedVoxel] / back[Formulation::kOcclusionAware], 20, 1e-9);
  EXPECT_TRUE(back.valid());
}

TEST_F(BoxSearch, InterruptedAnywhereEndsAsIfItHadNotBeen) {
  TuningScene scene(*views_, *truth_, options());
  bool whole = false;
  const FoundWeights uninterrupted = search(&scene, 1, kNeverStop, -1, nullptr, &whole);
  ASSERT_TRUE(whole);
  EXPECT_EQ(paid_, 31);
  EXPECT_GE(uninterrupted.value, uninterrupted.value_of_start);
  for (const int after : {1, 7, 20}) {
    std::filesystem::remove(log_);
    std::atomic<bool> stop = false;
    search(&scene, 2, stop, after, &stop, &whole);
    EXPECT_FALSE(whole);
    const FoundWeights resumed = search(&scene, 1, kNeverStop, -1, nullptr, &whole);
    ASSERT_TRUE(whole);
    EXPECT_EQ(paid_, 31 - after) << "nothing is paid for twice";
    EXPECT_EQ(resumed.x, uninterrupted.x);
    EXPECT_EQ(resumed.value, uninterrupted.value);
  }
}

}  // namespace
}  // namespace vantage
