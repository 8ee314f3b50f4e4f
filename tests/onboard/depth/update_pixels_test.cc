#include "onboard/depth/update_pixels.h"

#include <cmath>
#include <numeric>
#include <vector>

#include <gtest/gtest.h>

#include "onboard/depth/cpu_depth_backend.h"
#include "tests/onboard/depth/plane_scene.h"

namespace vantage {
namespace {

double sample(const ImagePyramid::Level& image, double x, double y) {
  x = std::clamp(x, 0.0, image.width - 1.001);
  y = std::clamp(y, 0.0, image.height - 1.001);
  const int x0 = static_cast<int>(x), y0 = static_cast<int>(y);
  const auto grey = [&](int u, int v) { return static_cast<double>(image.pixels[v * image.stride + u]); };
  const double fx = x - x0, fy = y - y0;
  return (1 - fy) * ((1 - fx) * grey(x0, y0) + fx * grey(x0 + 1, y0)) +
         fy * ((1 - fx) * grey(x0, y0 + 1) + fx * grey(x0 + 1, y0 + 1));
}

/// Patch and strip about a place, by the definition: a sample per point, doubles.
struct Window {
  double grey[kPatchRows][kPatchColumns];

  /// Of the frame, `step` and `line` as in Search.
  static Window of_frame(const UpdateJob& job, const Search& search, int step, int line) {
    Window window;
    for (int j = 0; j < kPatchRows; ++j) {
      for (int i = 0; i < kPatchColumns; ++i) {
        const double along = search.first + kStep * search.scale * 1.0 * (step + i - kPatchColumns / 2);
        const double across = search.scale * 1.0 * (j - kPatchRows / 2 + line - search.across);
        const double x = search.line.u0 + along * search.line.ex - across * search.line.ey;
        const double y = search.line.v0 + along * search.line.ey + across * search.line.ex;
        window.grey[j][i] = sample(job.frame[static_cast<std::size_t>(search.level)], (x + 0.5) / search.scale - 0.5,
                                   (y + 0.5) / search.scale - 0.5);
      }
    }
    return window;
  }

  static Window of_key(const UpdateJob& job, const Search& search, double x, double y) {
    Window window;
    for (int j = 0; j < kPatchRows; ++j) {
      for (int i = 0; i < kPatchColumns; ++i) {
        const double along = kStep * search.scale * 1.0 * (i - kPatchColumns / 2);
        const double across = search.scale * 1.0 * (j - kPatchRows / 2);
        const double du = along * search.line.ex - across * search.line.ey;
        const double dv = along * search.line.ey + across * search.line.ex;
        const float* m = search.line.to_key;
        const double kx = x + m[0] * du + m[1] * dv, ky = y + m[2] * du + m[3] * dv;
        window.grey[j][i] = sample(job.key[static_cast<std::size_t>(search.level)], (kx + 0.5) / search.scale - 0.5,
                                   (ky + 0.5) / search.scale - 0.5);
      }
    }
    return window;
  }

  double mean() const {
    double sum = 0;
    for (const auto& row : grey) sum = std::accumulate(std::begin(row), std::end(row), sum);
    return sum / kPatchSamples;
  }

  static double correlation(const Window& a, const Window& b) {
    const double ma = a.mean(), mb = b.mean();
    double ab = 0, aa = 0, bb = 0;
    for (int j = 0; j < kPatchRows; ++j) {
      for (int i = 0; i < kPatchColumns; ++i) {
        ab += (a.grey[j][i] - ma) * (b.grey[j][i] - mb);
        aa += (a.grey[j][i] - ma) * (a.grey[j][i] - ma);
        bb += (b.grey[j][i] - mb) * (b.grey[j][i] - mb);
      }
    }
    return ab / std::sqrt(aa * std::max(bb, 1.0));
  }
};

/// MatchSums by their definition.
MatchSums plain_sums(const Window& a, const Window& b) {
  constexpr int kInner = kPatchRows * (kPatchColumns - 2);
  const auto over_inner = [](auto&& value) {
    double sum = 0;
    for (int j = 0; j < kPatchRows; ++j) {
      for (int i = 1; i + 1 < kPatchColumns; ++i) sum += value(j, i);
    }
    return sum;
  };
  const double ma = over_inner([&](int j, int i) { return a.grey[j][i]; }) / kInner;
  const double mb = over_inner([&](int j, int i) { return b.grey[j][i]; }) / kInner;
  const double na = std::sqrt(over_inner([&](int j, int i) { return (a.grey[j][i] - ma) * (a.grey[j][i] - ma); }));
  const double nb = std::sqrt(over_inner([&](int j, int i) { return (b.grey[j][i] - mb) * (b.grey[j][i] - mb); }));
  const auto e = [&](int j, int i) { return (a.grey[j][i] - ma) / na - (b.grey[j][i] - mb) / nb; };
  const auto g = [&](int j, int i) {
    return ((a.grey[j][i + 1] - a.grey[j][i - 1]) / na + (b.grey[j][i + 1] - b.grey[j][i - 1]) / nb) / 4;
  };
  return {.gg = static_cast<float>(over_inner([&](int j, int i) { return g(j, i) * g(j, i); })),
          .ge = static_cast<float>(over_inner([&](int j, int i) { return g(j, i) * e(j, i); })),
          .ee = static_cast<float>(over_inner([&](int j, int i) { return e(j, i) * e(j, i); })),
          .g = static_cast<float>(over_inner(g))};
}

/// One pixel's update without vectors.
PixelBelief plain_update(const UpdateJob& job, const PixelBelief& belief, double x, double y) {
  const Search search = plan_search(job.geometry, job.settings, belief, static_cast<float>(x), static_cast<float>(y));
  if (search.kind != Search::Kind::kSearch) return belief;
  const Window key = Window::of_key(job, search, x, y);
  double gradient = 0;
  for (const auto& row : key.grey) {
    for (int i = 1; i + 1 < kPatchColumns; ++i) {
      gradient += (row[i + 1] - row[i - 1]) * (row[i + 1] - row[i - 1]) / (4 * kStep * kStep);
    }
  }
  const double least = job.settings.image_noise / job.settings.max_texture_sigma_px;
  if (gradient < 2 * least * least) return belief;
  const int lines = 2 * search.across + 1;
  std::vector<float> scores(static_cast<std::size_t>(lines * search.steps));
  for (int o = 0; o < lines; ++o) {
    for (int i = 0; i < search.steps; ++i) {
      scores[static_cast<std::size_t>(o * search.steps + i)] =
          static_cast<float>(Window::correlation(key, Window::of_frame(job, search, i, o)));
    }
  }
  Match match = best_match(search, job.settings, scores.data(), search.steps);
  if (match.kind == Match::Kind::kFound) {
    const Window there = Window::of_frame(job, search, match.step, match.line);
    finish_match(search, plain_sums(key, there), &match);
  }
  switch (match.kind) {
    case Match::Kind::kFound:
      return belief_after(belief, search, match, job.settings);
    case Match::Kind::kNone:
      return search.cut ? belief : missed_belief(belief);
    case Match::Kind::kAmbiguous:
      return belief;
  }
  return belief;
}

/// The same update as the vectors make: at a first frame (long searches, coarse levels), with a pose of 5 mm (lines to
/// either side), and later.
TEST(UpdatePixelsTest, IsWhatThePlainDefinitionGives) {
  const CameraModel camera = small_camera();
  PlaneScene scene;
  scene.rectangles = {{.z = 1.2, .grain_m = 0.03, .slope = 0.2, .seed = 1},
                      {.z = 0.7, .centre = {-0.1, 0}, .half = {0.12, 0.1}, .grain_m = 0.02, .seed = 2}};
  DepthFilterOptions options;
  options.min_depth_m = 0.4;
  options.max_depth_m = 4;
  ImagePyramid key(camera.width, camera.height), frame(camera.width, camera.height);
  key.build(photograph(scene, camera, camera_at(0, 0, 0), 1));
  const std::size_t pixels = static_cast<std::size_t>(camera.width * camera.height);
  std::vector<PixelBelief> beliefs(pixels, {.mean = 1.4F, .variance = 0.3F, .inliers = 10, .outliers = 10});
  std::vector<PixelState> states(pixels, PixelState::kUpdating);
  std::vector<std::uint32_t> active;
  for (int y = kBorder; y < camera.height - kBorder; ++y) {
    for (int x = kBorder; x < camera.width - kBorder; ++x)
      active.push_back(static_cast<std::uint32_t>(y * camera.width + x));
  }
  UpdateJob job;
  job.settings = pixel_settings(options, camera.width, camera.height);
  for (std::size_t l = 0; l < ImagePyramid::kLevels; ++l) {
    job.key[l] = key.level(static_cast<int>(l));
    job.frame[l] = frame.level(static_cast<int>(l));
  }
  job.beliefs = beliefs.data();
  job.states = states.data();

  const std::vector<Eigen::Isometry3d> poses = {camera_at(0.15, 0, 0), camera_at(0.02, 0.04, 0.03, 0.02),
                                                camera_at(-0.05, 0.01, -0.02, -0.03)};
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const Eigen::Isometry3d T = poses[i].inverse();
    PairGeometry& g = job.geometry;
    g = {.fx = static_cast<float>(camera.fx),
         .fy = static_cast<float>(camera.fy),
         .cx = static_cast<float>(camera.cx),
         .cy = static_cast<float>(camera.cy),
         .rotation = {},
         .translation = {},
         .covariance = {}};
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) g.rotation[3 * r + c] = static_cast<float>(T.linear()(r, c));
      g.translation[r] = static_cast<float>(T.translation()(r));
      if (i == 1) g.covariance[7 * r] = 0.005F * 0.005F;
    }
    frame.build(photograph(scene, camera, poses[i], i + 2));
    std::vector<PixelBelief> expected = beliefs;
    for (const std::uint32_t index : active) {
      expected[index] = plain_update(job, beliefs[index], index % static_cast<std::uint32_t>(camera.width),
                                     index / static_cast<std::uint32_t>(camera.width));
    }
    UpdateCounts counts;
    active.resize(static_cast<std::size_t>(update_pixels(job, active, &counts)));
    EXPECT_GT(counts.matched, counts.planned / 2);
    // A score within rounding of a threshold may fall to either side.
    int apart = 0;
    for (const std::uint32_t index : active) {
      const float sigma = std::sqrt(expected[index].variance);
      const bool same = std::abs(beliefs[index].mean - expected[index].mean) < 0.02F * sigma &&
                        std::abs(beliefs[index].inlier_ratio() - expected[index].inlier_ratio()) < 1e-3F;
      apart += same ? 0 : 1;
    }
    EXPECT_LT(apart, 0.005 * static_cast<double>(active.size())) << "frame " << i << " on " << update_pixels_target();
  }
}

}  // namespace
}  // namespace vantage
