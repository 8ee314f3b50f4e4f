#include "offboard/experiment/procedural_shape.h"

#include <set>

#include <gtest/gtest.h>
#include <unistd.h>

#include "drivers/sim/mesh.h"
#include "drivers/sim/surface_samples.h"

namespace vantage {
namespace {

TEST(ProceduralShape, OfANumberIsAlwaysTheSame) {
  for (std::uint64_t number = 1; number <= 12; ++number) {
    const PlyModel a = procedural_shape(number), b = procedural_shape(number);
    EXPECT_EQ(a.points, b.points) << number;
    EXPECT_EQ(a.triangles, b.triangles) << number;
    EXPECT_NE(a.points, procedural_shape(number + kShapeKinds).points) << number << " and the next of its kind";
  }
}

TEST(ProceduralShape, EachKindTakesItsTurn) {
  std::set<std::string_view> names;
  for (std::uint64_t number = 1; number <= kShapeKinds; ++number) names.insert(name_of(kind_of_shape(number)));
  EXPECT_EQ(names.size(), static_cast<std::size_t>(kShapeKinds));
  EXPECT_EQ(kind_of_shape(2), ShapeKind::kKnot);
  EXPECT_EQ(kind_of_shape(2 + kShapeKinds), ShapeKind::kKnot);
}

TEST(ProceduralShape, IsAnObjectThatCanBeLookedAt) {
  const std::filesystem::path file =
      std::filesystem::path(testing::TempDir()) / ("shape-" + std::to_string(::getpid()) + ".ply");
  for (std::uint64_t number = 1; number <= 4 * kShapeKinds; ++number) {
    write_ply(file, procedural_shape(number));
    const sim::Mesh mesh = sim::load_mesh(file);
    const Eigen::Vector3f size = mesh.highest() - mesh.lowest();
    EXPECT_NEAR(size.maxCoeff(), 0.3, 1e-5) << number;
    EXPECT_GT(size.minCoeff(), 0.03) << number << ": flat things tell little of a method";
    EXPECT_EQ(sim::sample_surface(mesh, 500).size(), 500U) << number;
  }
  std::filesystem::remove(file);
}

}  // namespace
}  // namespace vantage
