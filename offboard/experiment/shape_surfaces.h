#pragma once

#include <functional>
#include <vector>

#include <Eigen/Core>

#include "calib/files/ply.h"

namespace vantage {

/// Catmull and Rom's spline from b (t = 0) to c (t = 1), of numbers or vectors; a and d lie before and behind.
template <class Value>
Value catmull_rom(const Value& a, const Value& b, const Value& c, const Value& d, double t) {
  return b + 0.5 * t * (c - a + t * (2 * a - 5 * b + 4 * c - d + t * (3 * (b - c) + d - a)));
}

/// A point of a surface, u and v in [0, 1].
using Surface = std::function<Eigen::Vector3d(double u, double v)>;

/// Adds the surface as a grid of `columns` x `rows` cells. Where its edges meet, points lie twice.
void add_surface(const Surface& surface, int columns, int rows, PlyModel* mesh);

void add_box(const Eigen::Vector3d& low, const Eigen::Vector3d& high, PlyModel* mesh);

struct TubeStation {
  Eigen::Vector3d centre;
  double radius;
};
/// Adds a tube along a smooth line through the stations, as thick there as they say, with rounded ends.
/// \pre at least two stations, none on its neighbour
void add_tube(const std::vector<TubeStation>& stations, PlyModel* mesh);

/// Adds a ring about z from `low` to `high`: outwards to `radius(angle)`, inwards to `hole`; 0 makes it a disc.
void add_ring(const std::function<double(double angle)>& radius, double hole, double low, double high, PlyModel* mesh);

/// \param transform linear: of rotation and scale; points of `mesh` from number `first` on
void turn(const Eigen::Matrix3d& transform, PlyModel* mesh, std::size_t first = 0);
void shift(const Eigen::Vector3d& offset, PlyModel* mesh, std::size_t first = 0);

}  // namespace vantage
