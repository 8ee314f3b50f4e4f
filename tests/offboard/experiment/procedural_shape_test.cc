#include "offboard/experiment/procedural_shape.h"

#include <array>
#include <cmath>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include <Eigen/Geometry>
#include <gtest/gtest.h>
#include <unistd.h>

#include "drivers/sim/mesh.h"
#include "drivers/sim/surface_samples.h"
#include "offboard/experiment/shape_surfaces.h"

namespace vantage {
namespace {

/// One and a half rounds of the kinds from each range.
std::vector<std::uint64_t> some_numbers() {
  std::vector<std::uint64_t> numbers;
  for (std::uint64_t i = 0; i < 18; ++i)
    numbers.insert(numbers.end(), {1 + i, kFirstTurnedShape + i, kFirstHollowShape + i});
  return numbers;
}

TEST(ProceduralShape, OfANumberIsAlwaysTheSame) {
  for (const std::uint64_t number : some_numbers()) {
    const PlyModel a = procedural_shape(number), b = procedural_shape(number);
    EXPECT_EQ(a.points, b.points) << number;
    EXPECT_EQ(a.triangles, b.triangles) << number;
    const int kinds = number < kFirstTurnedShape ? kStandingKinds : number < kFirstHollowShape ? kTurnedKinds : 1;
    EXPECT_EQ(kind_of_shape(number), kind_of_shape(number + kinds));
    EXPECT_NE(a.points, procedural_shape(number + kinds).points) << number << " and the next of its kind";
  }
}

TEST(ProceduralShape, EachKindTakesItsTurn) {
  const auto names = [](std::uint64_t first, int count) {
    std::set<std::string_view> found;
    for (int i = 0; i < count; ++i) found.insert(name_of(kind_of_shape(first + static_cast<std::uint64_t>(i))));
    return found.size();
  };
  EXPECT_EQ(names(1, kStandingKinds), std::size_t{kStandingKinds});
  EXPECT_EQ(names(1, kTurnedKinds), std::size_t{kStandingKinds});
  EXPECT_EQ(names(kFirstTurnedShape, kTurnedKinds), std::size_t{kTurnedKinds});
  EXPECT_EQ(names(kFirstHollowShape, kTurnedKinds), 1U);
  EXPECT_EQ(kind_of_shape(2), ShapeKind::kKnot);
  EXPECT_EQ(kind_of_shape(kFirstTurnedShape), ShapeKind::kSuperquadric);
}

TEST(ProceduralShape, IsAnObjectThatCanBeLookedAt) {
  const std::filesystem::path file =
      std::filesystem::path(testing::TempDir()) / ("shape-" + std::to_string(::getpid()) + ".ply");
  for (const std::uint64_t number : some_numbers()) {
    const PlyModel shape = procedural_shape(number);
    for (const Eigen::Vector3f& point : shape.points) ASSERT_TRUE(point.allFinite()) << number;
    write_ply(file, shape);
    const sim::Mesh mesh = sim::load_mesh(file);
    const Eigen::Vector3f size = mesh.highest() - mesh.lowest();
    EXPECT_NEAR(size.maxCoeff(), 0.3, 1e-5) << number;
    EXPECT_GT(size.minCoeff(), number < kFirstTurnedShape ? 0.03 : 0.01)
        << number << ": flat things tell little of a method";
    EXPECT_EQ(sim::sample_surface(mesh, 500).size(), 500U) << number;
  }
  std::filesystem::remove(file);
}

TEST(ProceduralShape, TurnedOnesLieOnAnySide) {
  std::set<int> longest;
  for (std::uint64_t i = 0; i < 40; ++i) {
    const PlyModel shape = procedural_shape(kFirstTurnedShape + 6 + i * kTurnedKinds);  // creatures
    Eigen::AlignedBox3f box;
    for (const Eigen::Vector3f& point : shape.points) box.extend(point);
    int axis = 0;
    box.sizes().maxCoeff(&axis);
    longest.insert(axis);
  }
  EXPECT_EQ(longest, (std::set<int>{0, 1, 2}));
}

/// Every triangle of a closed surface has a neighbour across each edge; points that lie twice count as one.
int open_edges(const PlyModel& mesh) {
  const auto key = [&](std::uint32_t i) {
    const Eigen::Vector3f& p = mesh.points[i];
    return std::array<long, 3>{std::lround(p.x() * 1e4F), std::lround(p.y() * 1e4F), std::lround(p.z() * 1e4F)};
  };
  std::map<std::array<std::array<long, 3>, 2>, int> triangles;
  for (const auto& triangle : mesh.triangles) {
    for (std::size_t k = 0; k < 3; ++k) {
      std::array<std::array<long, 3>, 2> edge = {key(triangle[k]), key(triangle[(k + 1) % 3])};
      if (edge[0] == edge[1]) continue;
      if (edge[1] < edge[0]) std::swap(edge[0], edge[1]);
      ++triangles[edge];
    }
  }
  int open = 0;
  for (const auto& [edge, count] : triangles) open += count == 1;
  return open;
}

TEST(ShapeSurfaces, OfABoxATubeAndARingAreClosed) {
  PlyModel box, tube, ring, disc;
  add_box({0, 0, 0}, {1, 2, 3}, &box);
  add_tube({{{0, 0, 0}, 0.1}, {{0.5, 0.2, 0}, 0.2}, {{1, 0, 0.4}, 0.05}}, &tube);
  add_ring([](double angle) { return 1 + 0.2 * std::cos(5 * angle); }, 0.4, 0, 0.5, &ring);
  add_ring([](double) { return 1.0; }, 0, 0, 0.5, &disc);
  EXPECT_EQ(open_edges(box), 0);
  EXPECT_EQ(open_edges(tube), 0);
  EXPECT_EQ(open_edges(ring), 0);
  EXPECT_EQ(open_edges(disc), 0);
}

TEST(ShapeSurfaces, TubesAreAsThickAsTheirStationsSay) {
  constexpr double kSpline = 0.02;  // the line does not go evenly from station to station
  PlyModel tube;
  add_tube({{{0, 0, 0}, 0.2}, {{1, 0, 0}, 0.1}, {{2, 0, 0}, 0.2}}, &tube);
  Eigen::AlignedBox3f box;
  for (const Eigen::Vector3f& p : tube.points) {
    box.extend(p);
    const double radius = 0.1 + 0.1 * std::abs(p.x() - 1);
    EXPECT_LE(std::hypot(p.y(), p.z()), radius + kSpline) << p.transpose();
    if (p.x() > 0.3F && p.x() < 1.7F) {
      EXPECT_NEAR(std::hypot(p.y(), p.z()), radius, kSpline) << p.transpose();
    }
  }
  EXPECT_NEAR(box.min().x(), 0, 1e-3);
  EXPECT_NEAR(box.max().x(), 2, 1e-3);
}

}  // namespace
}  // namespace vantage
