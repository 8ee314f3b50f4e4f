#include "drivers/sim/surface_samples.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "box.h"
#include "calib/files/input_error.h"

namespace vantage::sim {
namespace {

const Box kBox{{-0.15, -0.1, 0}, {0.15, 0.1, 0.25}};

/// Distance from a box's surface.
double off_surface(const Box& box, const Eigen::Vector3f& point) {
  const Eigen::Vector3d p = point.cast<double>();
  const double outside = (box.low - p).cwiseMax(p - box.high).cwiseMax(0).norm();
  const double inside = std::min((p - box.low).minCoeff(), (box.high - p).minCoeff());
  return inside > 0 ? inside : outside;
}

/// The face that a point lies on: 0 to 5, low x, high x, low y, ...
int face_of(const Box& box, const Eigen::Vector3f& point) {
  int best = 0;
  double nearest = 1;
  for (int face = 0; face < 6; ++face) {
    const double distance =
        std::abs(static_cast<double>(point[face / 2]) - (face % 2 == 0 ? box.low : box.high)[face / 2]);
    if (distance < nearest) {
      nearest = distance;
      best = face;
    }
  }
  return best;
}

TEST(SurfaceSamples, LieOnTheSurfaceUniformlyByArea) {
  constexpr int kCells = 4;  // a side of a face
  const std::vector<Eigen::Vector3f> samples = sample_surface(kBox.mesh(), 48000, 11);
  ASSERT_EQ(samples.size(), 48000U);
  std::vector<int> counts(6 * kCells * kCells);
  for (const Eigen::Vector3f& p : samples) {
    ASSERT_LT(off_surface(kBox, p), 1e-6);
    const int face = face_of(kBox, p);
    int cell = face;
    for (int axis = 0; axis < 3; ++axis) {
      if (axis == face / 2) continue;
      const double along = (static_cast<double>(p[axis]) - kBox.low[axis]) / (kBox.high[axis] - kBox.low[axis]);
      cell = cell * kCells + std::clamp(static_cast<int>(along * kCells), 0, kCells - 1);
    }
    ++counts[static_cast<std::size_t>(cell)];
  }
  const Eigen::Vector3d size = kBox.high - kBox.low;
  const double areas[3] = {size.y() * size.z(), size.x() * size.z(), size.x() * size.y()};
  const double total = 2 * (areas[0] + areas[1] + areas[2]);
  double chi_square = 0;
  for (std::size_t cell = 0; cell < counts.size(); ++cell) {
    const double expected = 48000 * areas[cell / (2 * kCells * kCells)] / total / (kCells * kCells);
    chi_square += (counts[cell] - expected) * (counts[cell] - expected) / expected;
  }
  // 95 degrees of freedom: mean 95, standard deviation 14; 150 is exceeded once in 3,000 seeds.
  EXPECT_LT(chi_square, 150);
}

TEST(SurfaceSamples, TheUndersideStays) {
  int below = 0;
  for (const Eigen::Vector3f& p : sample_surface(kBox.mesh(), 20000)) below += face_of(kBox, p) == 4;
  // 0.06 of 0.37 m²; three standard errors.
  EXPECT_NEAR(below / 20000.0, 0.06 / 0.37, 0.008);
}

TEST(SurfaceSamples, WhatIsEnclosedIsDropped) {
  const Box inner{{-0.1, -0.05, 0.05}, {0.1, 0.05, 0.2}};
  for (const Eigen::Vector3f& p : sample_surface(joined(kBox.mesh(), inner.mesh()), 5000)) {
    ASSERT_LT(off_surface(kBox, p), 1e-6);
  }
}

TEST(SurfaceSamples, ABarIsKeptOnlyWhereItSticksOut) {
  // As the teapot's spout: a closed bar that runs on inside the body.
  const Box bar{{-0.3, -0.02, 0.1}, {0.3, 0.02, 0.14}};
  int outside = 0;
  for (const Eigen::Vector3f& p : sample_surface(joined(kBox.mesh(), bar.mesh()), 20000)) {
    const bool on_body = off_surface(kBox, p) < 1e-6, on_bar = off_surface(bar, p) < 1e-6;
    ASSERT_TRUE(on_body || on_bar);
    ASSERT_TRUE(on_body || std::abs(p.x()) > 0.15F - 1e-5F);
    outside += !on_body;
  }
  // Visible: the body's 0.37 m² less the two holes of 0.0016, the bar's two ends of 0.15 x 0.16 + 0.0016.
  const double bar_area = 2 * (0.15 * 0.16 + 0.0016), body_area = 0.37 - 2 * 0.0016;
  EXPECT_NEAR(outside / 20000.0, bar_area / (bar_area + body_area), 0.01);
}

TEST(SurfaceSamples, TheInsideOfAnOpenBoxStays) {
  Mesh open = kBox.mesh();
  open.triangles.erase(open.triangles.begin() + 2, open.triangles.begin() + 4);  // the lid
  const Box inner{{-0.05, -0.05, 0.02}, {0.05, 0.05, 0.06}};
  int on_inner = 0;
  for (const Eigen::Vector3f& p : sample_surface(joined(open, inner.mesh()), 20000)) {
    on_inner += off_surface(inner, p) < 1e-6;
  }
  // All of the small box but for its underside, which sees a slit of 20 mm: at least top and sides.
  const double inner_area = 0.01 + 4 * 0.1 * 0.04, outer_area = 0.31;
  EXPECT_GT(on_inner / 20000.0, inner_area / (inner_area + 0.01 + outer_area) - 0.01);
}

TEST(SurfaceSamples, SameSeedSamePoints) {
  EXPECT_EQ(sample_surface(kBox.mesh(), 500, 3), sample_surface(kBox.mesh(), 500, 3));
  EXPECT_NE(sample_surface(kBox.mesh(), 500, 3), sample_surface(kBox.mesh(), 500, 4));
}

TEST(SurfaceSamples, RefusesAMeshWithoutArea) {
  Mesh needle;
  needle.points = {{0, 0, 0}, {0, 0, 1}, {0, 0, 2}};
  needle.triangles = {{0, 1, 2}};
  EXPECT_THROW(sample_surface(needle, 10), InputError);
}

}  // namespace
}  // namespace vantage::sim
