#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "drivers/sim/mesh.h"

namespace vantage::sim {

/// How many directions are tried before a point counts as enclosed.
inline constexpr int kEscapeDirections = 256;

/// `count` points uniform by area on the outer surface of an object: what "surface coverage" (paper, Eq. 14) is a share
/// of.
///
/// A mesh's triangles may lie where no camera ever sees them, as where the teapot's spout and handle run on inside its
/// body. A point is kept when, from just off either side of its triangle, at least one of kEscapeDirections directions,
/// spread evenly over the sphere, leaves the object without meeting it. So the inside of an open spout stays where it
/// can be looked into; the underside stays, too: the ground counts for nothing here.
///
/// Same mesh, count and seed, same points. Order is random: the first n are a fair sample as well.
/// \throws InputError when no point in a thousand lies on an outer surface, or all triangles are without area.
std::vector<Eigen::Vector3f> sample_surface(const Mesh& mesh, std::size_t count, std::uint64_t seed = 1);

}  // namespace vantage::sim
