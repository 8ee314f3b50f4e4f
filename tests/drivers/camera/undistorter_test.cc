// The simulator renders through the lens and without it: both must come to the same.
#include "drivers/camera/undistorter.h"

#include <array>
#include <cmath>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "calib/look_at.h"
#include "drivers/sim/boxes_room.h"
#include "drivers/sim/renderer.h"
#include "drivers/sim/sensor.h"

namespace vantage {
namespace {

GreyImage photograph(const sim::Renderer& renderer, const CameraModel& camera) {
  std::vector<float> radiance;
  renderer.render(camera, look_at({1.2, 0.3, 0.8}, {0, 0, 0.2}), &radiance);
  auto pixels = std::make_shared<std::vector<std::uint8_t>>(radiance.size());
  sim::expose(radiance, sim::kReferenceExposure_s, 0, 1, *pixels);
  return {camera.width, camera.height, camera.width, {pixels, pixels->data()}};
}

constexpr CameraModel kSmall{320, 240, 230, 230, 159.5, 119.5, Distortion::kNone, {}};

CameraModel lens_named(const std::string& name) {
  CameraModel camera = kSmall;
  camera.distortion = name == "radtan" ? Distortion::kRadTan : Distortion::kEquidistant;
  camera.coefficients =
      name == "radtan" ? std::array{-0.3, 0.1, 0.001, -0.002, 0.0} : std::array{0.02, -0.01, 0.003, 0.0, 0.0};
  return camera;
}

class UndistorterTest : public testing::TestWithParam<std::string> {};

TEST_P(UndistorterTest, GivesWhatAPinholeWouldHaveSeen) {
  const CameraModel lens = lens_named(GetParam());
  const Undistorter undistorter(lens);
  EXPECT_EQ(undistorter.pinhole().distortion, Distortion::kNone);
  EXPECT_EQ(undistorter.pinhole().fx, lens.fx);
  const sim::Renderer renderer(sim::boxes_room(1));
  const GreyImage bent = photograph(renderer, lens), wanted = photograph(renderer, undistorter.pinhole());
  const GreyImage straight = undistorter.undistort(bent);
  ASSERT_EQ(straight.width, lens.width);
  ASSERT_EQ(straight.height, lens.height);
  // Mean over blocks of 4 x 4 in the middle half: detail as fine as a pixel does not survive interpolation.
  const auto difference = [&](const GreyImage& image) {
    double sum = 0;
    int blocks = 0;
    for (int v = lens.height / 4; v < 3 * lens.height / 4; v += 4) {
      for (int u = lens.width / 4; u < 3 * lens.width / 4; u += 4, ++blocks) {
        int block = 0;
        for (int k = 0; k < 16; ++k) {
          block += image.pixels.get()[(v + k / 4) * image.stride + u + k % 4];
          block -= wanted.pixels.get()[(v + k / 4) * wanted.stride + u + k % 4];
        }
        sum += std::abs(block) / 16.0;
      }
    }
    return sum / blocks;
  };
  EXPECT_LT(difference(straight), 1);
  EXPECT_GT(difference(bent), 4);
}

INSTANTIATE_TEST_SUITE_P(Lenses, UndistorterTest, testing::Values("radtan", "equidistant"));

TEST(Undistorter, CopiesWhatNeedsNoMending) {
  const sim::Renderer renderer(sim::boxes_room(1));
  const GreyImage image = photograph(renderer, kSmall);
  const GreyImage copy = Undistorter(kSmall).undistort(image);
  EXPECT_NE(copy.pixels, image.pixels);
  for (int v = 0; v < kSmall.height; ++v) {
    for (int u = 0; u < kSmall.width; ++u) {
      ASSERT_EQ(copy.pixels.get()[v * copy.stride + u], image.pixels.get()[v * image.stride + u]);
    }
  }
}

}  // namespace
}  // namespace vantage
