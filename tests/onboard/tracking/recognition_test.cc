#include <random>

#include <gtest/gtest.h>

#include "onboard/tracking/corner_detector.h"
#include "onboard/tracking/descriptor.h"
#include "onboard/tracking/descriptor_matching.h"
#include "onboard/tracking/place_index.h"
#include "onboard/tracking/rigid_motion.h"
#include "onboard/tracking/two_view_start.h"
#include "tests/onboard/tracking/textured_scene.h"

namespace vantage::tracking {
namespace {

TEST(Descriptor, TurnsWithThePatch) {
  // The same picture, turned by 90 degrees: (u, v) of one is (v, 63 - u) of the other.
  const auto picture = [](bool turned) {
    auto pixels = std::make_shared<std::vector<std::uint8_t>>(64 * 64);
    for (int v = 0; v < 64; ++v) {
      for (int u = 0; u < 64; ++u) {
        const double grey = 40 + 170 * lattice_noise(u / 5.0, v / 5.0, 9);
        const int at = turned ? (63 - u) * 64 + v : v * 64 + u;
        (*pixels)[static_cast<std::size_t>(at)] = static_cast<std::uint8_t>(std::lround(grey));
      }
    }
    GreyImage image;
    image.width = image.height = 64;
    image.stride = 64;
    image.pixels = {pixels, pixels->data()};
    return image;
  };
  ImagePyramid upright, turned;
  upright.build(picture(false));
  turned.build(picture(true));
  Descriptor a, b, other;
  ASSERT_TRUE(describe(upright.level(0), 31, 30, &a));
  ASSERT_TRUE(describe(turned.level(0), 30, 32, &b));
  ASSERT_TRUE(describe(upright.level(0), 36, 35, &other));
  EXPECT_LT(hamming_distance(a, b), 30);
  EXPECT_GT(hamming_distance(a, other), 60);
  EXPECT_EQ(hamming_distance(a, a), 0);
  EXPECT_FALSE(describe(upright.level(0), 16, 30, &a)) << "the patch reaches out of the image";
}

Descriptor random_descriptor(std::mt19937_64* random) { return {(*random)(), (*random)(), (*random)(), (*random)()}; }

TEST(PlaceIndex, FindsThePlaceWhoseWordsAFrameShares) {
  constexpr unsigned kSeed = 8;
  SCOPED_TRACE("seed " + std::to_string(kSeed));
  std::mt19937_64 random(kSeed);
  PlaceIndex index;
  std::vector<std::vector<Descriptor>> places(60);
  for (std::size_t i = 0; i < places.size(); ++i) {
    for (int k = 0; k < 150; ++k) places[i].push_back(random_descriptor(&random));
    index.add(i + 1, places[i]);
  }
  for (std::size_t i = 0; i < places.size(); i += 7) {
    // A third of the place's points, an eighth of their bits wrong, among twice as many others.
    std::vector<Descriptor> seen;
    for (std::size_t k = 0; k < 50; ++k) {
      Descriptor noisy = places[i][k];
      for (int bit = 0; bit < 32; ++bit) noisy[random() % 4] ^= std::uint64_t{1} << (random() % 64);
      seen.push_back(noisy);
    }
    for (int k = 0; k < 100; ++k) seen.push_back(random_descriptor(&random));
    const auto found = index.query(seen, 5);
    ASSERT_FALSE(found.empty());
    EXPECT_EQ(found.front().first, i + 1);
  }
  index.remove(1);
  for (const auto& [place, score] : index.query(places[0], 60)) EXPECT_NE(place, 1U);
}

TEST(DescriptorMatching, PairsAreMutualAndClear) {
  std::mt19937_64 random(4);
  std::vector<Descriptor> a, b;
  for (int i = 0; i < 40; ++i) a.push_back(random_descriptor(&random));
  for (int i = 39; i >= 20; --i) b.push_back(a[static_cast<std::size_t>(i)]);
  b.push_back(b.front());  // two in b alike: the pair is not clear
  const auto pairs = match_descriptors(a, b);
  EXPECT_EQ(pairs.size(), 20U - 1U + 1U - (a[39] == b.back() ? 0U : 1U));
  for (const auto& [i, j] : pairs) EXPECT_EQ(a[static_cast<std::size_t>(i)], b[static_cast<std::size_t>(j)]);
}

TEST(CornerDetector, OneACellAndNoneWhereOccupied) {
  ImagePyramid image;
  image.build(TexturedScene::render(quarter_camera(), TexturedScene::sway(0), 0).image);
  const std::vector<Corner> corners = detect_corners(image, {});
  EXPECT_GT(corners.size(), 60U);
  std::vector<Eigen::Vector2d> occupied;
  for (const Corner& corner : corners) occupied.push_back(corner.pixel);
  EXPECT_TRUE(detect_corners(image, occupied).size() < 5);
  const DetectorOptions options;
  std::vector<int> cells;
  for (const Corner& corner : corners) {
    cells.push_back(static_cast<int>(corner.pixel.y()) / options.cell_px * 1000 +
                    static_cast<int>(corner.pixel.x()) / options.cell_px);
  }
  std::sort(cells.begin(), cells.end());
  EXPECT_EQ(std::adjacent_find(cells.begin(), cells.end()), cells.end());
}

TEST(TwoViewStart, FindsTheMotionWithinTwentyPixelsOfParallax) {
  const CameraModel camera = quarter_camera();
  TwoViewStart starter(camera);
  std::optional<Start> start;
  std::uint64_t i = 0;
  for (; i < 60 && !start; ++i) {
    StartFrame frame;
    frame.sequence = i;
    auto pyramid = std::make_shared<ImagePyramid>();
    const double t = 0.03 * static_cast<double>(i);
    pyramid->build(TexturedScene::render(camera, TexturedScene::sway(t), i).image);
    frame.image = pyramid;
    start = starter.add(frame);
  }
  ASSERT_TRUE(start);
  // Parallax: what is left of the points' way when the turn is taken off.
  EXPECT_LT(start->parallax_rad * camera.fx, 20);
  const Eigen::Isometry3d truth = TexturedScene::sway(0.03 * static_cast<double>(start->last.sequence)).inverse() *
                                  TexturedScene::sway(0.03 * static_cast<double>(start->first.sequence));
  EXPECT_GT(start->T_last_first.translation().normalized().dot(truth.translation().normalized()), 0.98);
  const Eigen::Quaterniond turn(Eigen::Matrix3d(start->T_last_first.linear() * truth.linear().transpose()));
  EXPECT_LT(rotation_log(turn).norm(), 0.01);
  EXPECT_GE(start->points.size(), 40U);
}

TEST(TwoViewStart, APureTurnIsNoStart) {
  const CameraModel camera = quarter_camera();
  TwoViewStart starter(camera);
  for (std::uint64_t i = 0; i < 12; ++i) {
    StartFrame frame;
    frame.sequence = i;
    auto pyramid = std::make_shared<ImagePyramid>();
    pyramid->build(
        TexturedScene::render(camera, TexturedScene::pose({0.2, -0.3, 0.9}, 0.015 * static_cast<double>(i)), i).image);
    frame.image = pyramid;
    EXPECT_FALSE(starter.add(frame)) << "frame " << i << ", " << starter.disparity_px() << " px";
  }
  EXPECT_GT(starter.disparity_px(), 20);
}

}  // namespace
}  // namespace vantage::tracking
