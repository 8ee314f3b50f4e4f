#include "offboard/planning/learned_weights.h"

#include <cmath>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>

#include <gtest/gtest.h>
#include <unistd.h>

#include "calib/files/input_error.h"

namespace vantage {
namespace {

/// Occupied voxels of a box's side, seen from -x, with what it hides unknown and marked behind it.
OccupancyMap wall(int width, int height, const Eigen::Vector3i& corner) {
  OccupancyMap map(Region{{-0.32, -0.32, 0}, {64, 64, 64}, 0.01});
  for (int y = 0; y < width; ++y) {
    for (int z = 0; z < height; ++z) {
      map.set_log_odds(corner + Eigen::Vector3i(0, y, z), 2);
      for (int x = 1; x < 10; ++x) map.set_occlusion_distance(corner + Eigen::Vector3i(x, y, z), 0.01 * x);
    }
  }
  map.set_has_marks(true);
  return map;
}

TEST(ShapeDescriptor, DoesNotChangeWithThePlace) {
  const ShapeDescriptor a = describe_shape(wall(12, 20, {10, 10, 5})), b = describe_shape(wall(12, 20, {30, 17, 5}));
  for (std::size_t i = 0; i < ShapeDescriptor::kSize; ++i) EXPECT_NEAR(a.value[i], b.value[i], 1e-9);
}

TEST(ShapeDescriptor, TellsTallFromWideAndFlatFromRough) {
  const ShapeDescriptor tall = describe_shape(wall(8, 24, {10, 10, 5})),
                        wide = describe_shape(wall(24, 8, {10, 10, 5}));
  EXPECT_NEAR(tall.value[0], std::log(24.0 / 8), 0.05);
  EXPECT_NEAR(wide.value[0], -tall.value[0], 0.05);
  EXPECT_NEAR(tall.value[3], 0, 1e-9) << "a plane is not rough";
  OccupancyMap rough = wall(12, 20, {10, 10, 5});
  for (int y = 10; y < 22; y += 2) {
    for (int z = 5; z < 25; z += 2) rough.set_log_odds({8, y, z}, 2);
  }
  EXPECT_GT(describe_shape(rough).value[3], 0.02);
  EXPECT_NEAR(tall.value[4], std::log(9.0), 0.01) << "nine hidden voxels behind each seen one";
}

TEST(ShapeDescriptor, LooksAboveTheGroundAlone) {
  OccupancyMap map = wall(12, 20, {10, 10, 5});
  const ShapeDescriptor without = describe_shape(map);
  for (int x = 0; x < 64; ++x) {
    for (int y = 0; y < 64; ++y) map.set_log_odds({x, y, 0}, 2);
  }
  EXPECT_EQ(describe_shape(map).value, without.value);
  EXPECT_EQ(describe_shape(OccupancyMap(map.region())).value, ShapeDescriptor().value);
}

class Weights : public testing::Test {
 protected:
  void TearDown() override { std::filesystem::remove(path_); }
  static LearnedWeights two_objects() {
    CombinedWeights wide, tall;
    wide[Formulation::kAreaFactor] = 1.0 / 3;
    tall[Formulation::kRearSideVoxel] = 7;
    return {CombinedWeights::robot(),
            {{"wide", wide, {describe_shape(wall(24, 8, {10, 10, 5})), describe_shape(wall(20, 8, {10, 10, 5}))}},
             {"tall", tall, {describe_shape(wall(8, 24, {10, 10, 5}))}}}};
  }
  void write(const std::string& text) { std::ofstream(path_) << text; }
  std::string saved() {
    two_objects().save(path_, "seeds 2");
    std::ifstream stream(path_);
    return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
  }

  std::filesystem::path path_ =
      std::filesystem::path(testing::TempDir()) / ("learned_weights_test-" + std::to_string(::getpid()));
};

TEST_F(Weights, ComeBackToTheBit) {
  const LearnedWeights before = two_objects();
  before.save(path_, "seeds 2\nviews 12");
  const LearnedWeights after = LearnedWeights::load(path_);
  EXPECT_EQ(after.all().weight, before.all().weight);
  ASSERT_EQ(after.objects().size(), 2U);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(after.objects()[i].name, before.objects()[i].name);
    EXPECT_EQ(after.objects()[i].weights.weight, before.objects()[i].weights.weight);
    ASSERT_EQ(after.objects()[i].seen.size(), before.objects()[i].seen.size());
    EXPECT_EQ(after.objects()[i].seen[0].value, before.objects()[i].seen[0].value);
  }
}

TEST_F(Weights, OfTheNearestObjectAreThoseOfTheSameShape) {
  const LearnedWeights learned = two_objects();
  EXPECT_EQ(learned.nearest(wall(9, 25, {20, 30, 5})).weight, learned.objects()[1].weights.weight);
  EXPECT_EQ(learned.nearest(wall(26, 9, {20, 30, 5})).weight, learned.objects()[0].weights.weight);
  EXPECT_EQ(LearnedWeights(CombinedWeights::robot(), {}).nearest(wall(9, 9, {20, 30, 5})).weight,
            CombinedWeights::robot().weight);
}

TEST_F(Weights, FaultsOfAFileNameTheLine) {
  const std::string good = saved();
  const auto fault = [&](const std::string& text) -> std::string {
    write(text);
    try {
      LearnedWeights::load(path_);
    } catch (const InputError& error) {
      return error.what();
    }
    return "no fault";
  };
  EXPECT_EQ(fault(good), "no fault");
  EXPECT_NE(fault("").find("cut short"), std::string::npos);
  EXPECT_NE(fault("hello\n").find(":1: expected \"vantage-weights 1\""), std::string::npos);
  EXPECT_NE(fault("vantage-weights 1\nall 1 2\n").find(":2: all"), std::string::npos);
  EXPECT_NE(fault("vantage-weights 1\nwat\n").find(":2: wat"), std::string::npos);
  EXPECT_NE(fault("vantage-weights 1\nformulations entropy\n").find("learn them anew"), std::string::npos);
  std::string negative = good;
  negative.replace(negative.find("object wide ") + 12, 1, "-1");
  EXPECT_NE(fault(negative).find("object: expected a name and 8 weights"), std::string::npos);
  EXPECT_NE(fault(good.substr(0, good.rfind("seen"))).find("object tall has no line seen"), std::string::npos);
  std::string not_a_number = good;
  not_a_number.replace(not_a_number.rfind(' ') + 1, 3, "nan");
  EXPECT_NE(fault(not_a_number).find("seen: expected"), std::string::npos);
  std::filesystem::remove(path_);
  EXPECT_THROW(LearnedWeights::load(path_), InputError);
}

TEST_F(Weights, ThatAreNotValidAreNotTaken) {
  CombinedWeights none;
  none.weight.fill(0);
  EXPECT_THROW(LearnedWeights(none, {}), std::invalid_argument);
  EXPECT_THROW(LearnedWeights(CombinedWeights(), {{"a", none, {ShapeDescriptor()}}}), std::invalid_argument);
  EXPECT_THROW(LearnedWeights(CombinedWeights(), {{"a", CombinedWeights(), {}}}), std::invalid_argument);
}

}  // namespace
}  // namespace vantage
