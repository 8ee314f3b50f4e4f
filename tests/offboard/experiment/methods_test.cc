#include "offboard/experiment/methods.h"

#include <algorithm>
#include <set>

#include <gtest/gtest.h>

#include "calib/files/input_error.h"

namespace vantage {
namespace {

TEST(Methods, AreThePapersEightAndOurs) {
  EXPECT_EQ(parse_methods({"paper"}).size(), 8U);
  EXPECT_EQ(parse_methods({"all"}, true), method_names());
  EXPECT_EQ(parse_methods({"all"}).size(), method_names().size() - 2) << "there are no learned weights";
  EXPECT_THROW(parse_methods({"combined_nearest"}), InputError);
  EXPECT_EQ(parse_methods({"combined_nearest"}, true).size(), 1U);
  EXPECT_EQ(parse_methods({"oracle", "combined", "oracle"}), (std::vector<std::string>{"combined", "oracle"}));
  EXPECT_THROW(parse_methods({"entropy"}), InputError);  // Eq. 2 alone is none of the paper's methods
  EXPECT_THROW(parse_methods({}), InputError);
}

TEST(FirstView, IsViewZeroForSeedOneAndSpreadsForOthers) {
  EXPECT_EQ(first_view_of_seed(1, 48), 0);
  std::set<std::int64_t> views;
  for (std::uint64_t seed = 2; seed < 60; ++seed) {
    const std::int64_t view = first_view_of_seed(seed, 48);
    EXPECT_GE(view, 0);
    EXPECT_LT(view, 48);
    views.insert(view);
  }
  EXPECT_GT(views.size(), 24U);
}

class Chooser : public testing::Test {
 protected:
  std::int64_t choose(ViewChooser& chooser, std::vector<std::int64_t> visited) {
    std::vector<CandidateView> open;
    for (const CandidateView& view : views_) {
      if (std::find(visited.begin(), visited.end(), view.id) == visited.end()) open.push_back(view);
    }
    std::vector<Eigen::Isometry3d> poses;
    for (const std::int64_t id : visited) poses.push_back(views_[static_cast<std::size_t>(id)].T_world_camera);
    return open[chooser.choose({map_, camera_, open, visited, poses}).place].id;
  }

  std::vector<CandidateView> views_ = cylinder_views();
  OccupancyMap map_;
  CameraModel camera_{752, 480, 448, 448, 375.5, 239.5, Distortion::kNone, {}};
  TrueCoverage none_;
};

TEST_F(Chooser, SequentialGoesRoundFromTheFirstView) {
  const auto sequential = make_chooser("sequential", 1, none_);
  EXPECT_EQ(choose(*sequential, {45}), 46);
  EXPECT_EQ(choose(*sequential, {45, 46, 47}), 0);
  EXPECT_EQ(choose(*sequential, {46, 47, 0}), 1);
}

TEST_F(Chooser, RandomRepeatsWithItsSeedAlone) {
  const auto draw = [&](std::uint64_t seed) {
    const auto random = make_chooser("random", seed, none_);
    std::vector<std::int64_t> ids;
    for (int i = 0; i < 20; ++i) ids.push_back(choose(*random, {0}));
    return ids;
  };
  EXPECT_EQ(draw(5), draw(5));
  EXPECT_NE(draw(5), draw(6));
}

TEST_F(Chooser, OracleTakesTheMostNotYetCovered) {
  TrueCoverage truth;
  for (const CandidateView& view : views_) {
    truth.view_ids.push_back(view.id);
    truth.covered.push_back({0});
  }
  truth.covered[0] = {0b1111};
  truth.covered[7] = {0b11111};    // one more than view 0
  truth.covered[9] = {0b1100000};  // two more: less in all, but more that is new
  const auto oracle = make_chooser("oracle", 1, truth);
  EXPECT_EQ(choose(*oracle, {0}), 9);
  EXPECT_EQ(choose(*oracle, {0, 9}), 7);
  // Nothing more to gain, so the nearest: 0.2 m above view 7, where its neighbours on the ring are 0.23 m away.
  EXPECT_EQ(choose(*oracle, {0, 9, 7}), 23);
}

}  // namespace
}  // namespace vantage
