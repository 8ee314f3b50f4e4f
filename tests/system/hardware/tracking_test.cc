// vantage-track on a camera of the kernel's: vivid shows what a camera sees that goes round in a circle before a wall.

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <gtest/gtest.h>
#include <linux/videodev2.h>

#include "calib/files/trajectory.h"
#include "shell.h"
#include "vivid_feeder.h"

namespace vantage {
namespace {

constexpr double kFocal_px = 460, kCentreU_px = 319.5, kCentreV_px = 239.5;
constexpr double kRadius_m = 0.15;
constexpr int kFramesARound = 90;

/// A pattern without repetition within 4 m: noise of four octaves.
class Wallpaper {
 public:
  Wallpaper() : grey_(kSide * kSide) {
    std::mt19937 random(1);
    for (int step = 16; step >= 2; step /= 2) {
      const int cells = kSide / step;
      std::vector<double> lattice(static_cast<std::size_t>(cells * cells));
      for (double& value : lattice) value = static_cast<double>(random() % 1000) / 1000 - 0.5;
      const auto at = [&](int x, int y) { return lattice[static_cast<std::size_t>(y % cells * cells + x % cells)]; };
      for (int y = 0; y < kSide; ++y) {
        for (int x = 0; x < kSide; ++x) {
          const int cx = x / step, cy = y / step;
          const double du = static_cast<double>(x % step) / step, dv = static_cast<double>(y % step) / step;
          grey_[index(x, y)] += 60 * ((1 - dv) * ((1 - du) * at(cx, cy) + du * at(cx + 1, cy)) +
                                      dv * ((1 - du) * at(cx, cy + 1) + du * at(cx + 1, cy + 1)));
        }
      }
    }
  }

  /// Grey level, 0 to 255, of a place on the wall, m.
  double at(double x_m, double y_m) const {
    const double x = x_m / kTexel_m + kSide / 2.0, y = y_m / kTexel_m + kSide / 2.0;
    const int ix = static_cast<int>(x), iy = static_cast<int>(y);
    const double du = x - ix, dv = y - iy;
    return 128 + (1 - dv) * ((1 - du) * grey_[index(ix, iy)] + du * grey_[index(ix + 1, iy)]) +
           dv * ((1 - du) * grey_[index(ix, iy + 1)] + du * grey_[index(ix + 1, iy + 1)]);
  }

 private:
  static constexpr int kSide = 1024;
  static constexpr double kTexel_m = 0.004;
  static std::size_t index(int x, int y) {
    return static_cast<std::size_t>(std::clamp(y, 0, kSide - 1) * kSide + std::clamp(x, 0, kSide - 1));
  }
  std::vector<double> grey_;
};

/// What the camera sees in picture n. The wall is the plane z = 1 m + 0.3 x; the camera looks along z and does not
/// turn.
std::vector<std::uint8_t> view_of(const Wallpaper& wall, std::uint32_t n) {
  const double angle = 2 * std::numbers::pi * n / kFramesARound;
  const double x = kRadius_m * std::cos(angle), y = kRadius_m * std::sin(angle);
  std::vector<std::uint8_t> image;
  image.reserve(static_cast<std::size_t>(kVividWidth) * kVividHeight);
  for (int v = 0; v < kVividHeight; ++v) {
    for (int u = 0; u < kVividWidth; ++u) {
      const double right = (u - kCentreU_px) / kFocal_px, down = (v - kCentreV_px) / kFocal_px;
      const double depth = (1 + 0.3 * x) / (1 - 0.3 * right);
      image.push_back(static_cast<std::uint8_t>(std::clamp(wall.at(x + depth * right, y + depth * down), 0.0, 255.0)));
    }
  }
  return image;
}

TEST(V4l2Tracking, FollowsACameraOfTheKernels) {
  char folder[] = "/tmp/tracking-XXXXXX";
  ASSERT_NE(::mkdtemp(folder), nullptr);
  const std::filesystem::path here = folder;
  std::ofstream(here / "camera.yaml") << "width: 640\nheight: 480\nfx: 460\nfy: 460\ncx: 319.5\ncy: 239.5\n";
  const Wallpaper wall;
  const VividFeeder feeder(V4L2_PIX_FMT_GREY, [&](std::uint32_t n) { return view_of(wall, n); });
  constexpr int kFrames = 150;
  const std::string out = (here / "trajectory.txt").string();
  Process track({std::string(VANTAGE_BIN) + "/vantage-track", "v4l2:/dev/video0", "--camera-file",
                 (here / "camera.yaml").string(), "--frames", std::to_string(kFrames), "--out", out},
                (here / "log").string());
  ASSERT_EQ(track.wait(), 0) << track.text();
  std::printf("%s", track.text().c_str());

  // A circle, whatever its scale, place and turn are.
  const std::vector<StampedPose> trajectory = read_tum_trajectory(out);
  EXPECT_GT(trajectory.size(), 0.9 * kFrames);
  // One round, so that the mean is the centre.
  ASSERT_GT(trajectory.size(), static_cast<std::size_t>(kFramesARound));
  const auto begin = trajectory.end() - kFramesARound;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (auto pose = begin; pose != trajectory.end(); ++pose)
    centre += pose->T_world_camera.translation() / kFramesARound;
  double sum = 0, squares = 0;
  for (auto pose = begin; pose != trajectory.end(); ++pose) {
    const double radius = (pose->T_world_camera.translation() - centre).norm();
    sum += radius;
    squares += radius * radius;
  }
  const double mean = sum / kFramesARound;
  const double spread = std::sqrt(std::max(squares / kFramesARound - mean * mean, 0.0));
  std::printf("radius %.4f of the start's distance, spread %.2f %% of it\n", mean, 100 * spread / mean);
  EXPECT_LT(spread, 0.02 * mean);
  std::filesystem::remove_all(here);
}

}  // namespace
}  // namespace vantage
