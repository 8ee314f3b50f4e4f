#include "offboard/experiment/shape_surfaces.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>

#include <Eigen/Geometry>

namespace vantage {
namespace {

using std::numbers::pi;

/// On the spline through the stations, `at` from 0 to their number less one.
TubeStation between(const std::vector<TubeStation>& stations, double at) {
  const auto last = std::ssize(stations) - 1;
  const auto i = std::clamp<std::ptrdiff_t>(static_cast<std::ptrdiff_t>(at), 0, last - 1);
  const double t = at - static_cast<double>(i);
  const auto station = [&](std::ptrdiff_t k) {
    return stations[static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(k, 0, last))];
  };
  const TubeStation a = station(i - 1), b = station(i), c = station(i + 1), d = station(i + 2);
  return {catmull_rom(a.centre, b.centre, c.centre, d.centre, t), b.radius + t * (c.radius - b.radius)};
}

}  // namespace

void add_surface(const Surface& surface, int columns, int rows, PlyModel* mesh) {
  const auto first = static_cast<std::uint32_t>(mesh->points.size());
  for (int j = 0; j <= rows; ++j) {
    for (int i = 0; i <= columns; ++i) {
      mesh->points.push_back(surface(static_cast<double>(i) / columns, static_cast<double>(j) / rows).cast<float>());
    }
  }
  const auto at = [&](int i, int j) {
    return first + static_cast<std::uint32_t>(i) +
           static_cast<std::uint32_t>(j) * static_cast<std::uint32_t>(columns + 1);
  };
  for (int j = 0; j < rows; ++j) {
    for (int i = 0; i < columns; ++i) {
      mesh->triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      mesh->triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  }
}

void add_box(const Eigen::Vector3d& low, const Eigen::Vector3d& high, PlyModel* mesh) {
  for (int axis = 0; axis < 3; ++axis) {
    for (int side = 0; side < 2; ++side) {
      add_surface(
          [&](double u, double v) {
            Eigen::Vector3d share;
            share[axis] = side;
            share[(axis + 1) % 3] = u;
            share[(axis + 2) % 3] = v;
            return Eigen::Vector3d(low + share.cwiseProduct(high - low));
          },
          1, 1, mesh);
    }
  }
}

void add_tube(const std::vector<TubeStation>& stations, PlyModel* mesh) {
  const auto last = static_cast<double>(stations.size() - 1);
  const auto round_end = [](double from_end_in_radii) {  // a half ball's profile
    const double x = std::clamp(1 - from_end_in_radii, 0.0, 1.0);
    return std::sqrt(1 - x * x);
  };
  double length = 0;
  for (std::size_t i = 1; i < stations.size(); ++i) length += (stations[i].centre - stations[i - 1].centre).norm();
  add_surface(
      [&](double u, double v) {
        const double along = 0.5 - 0.5 * std::cos(pi * v);  // closer at the ends
        const TubeStation here = between(stations, along * last);
        constexpr double kStep = 1e-3;
        const Eigen::Vector3d ahead = between(stations, std::min(last, along * last + kStep)).centre,
                              behind = between(stations, std::max(0.0, along * last - kStep)).centre;
        const Eigen::Vector3d direction = (ahead - behind).normalized();
        const Eigen::Vector3d other =
            std::abs(direction.y()) < 0.9 ? Eigen::Vector3d::UnitY() : Eigen::Vector3d::UnitX();
        const Eigen::Vector3d side = direction.cross(other).normalized();
        const double radius = here.radius * round_end(along * length / stations.front().radius) *
                              round_end((1 - along) * length / stations.back().radius);
        const double angle = 2 * pi * u;
        return Eigen::Vector3d(here.centre +
                               radius * (std::cos(angle) * side + std::sin(angle) * direction.cross(side)));
      },
      20, 12 + 8 * static_cast<int>(stations.size()), mesh);
}

void add_ring(const std::function<double(double angle)>& radius, double hole, double low, double high, PlyModel* mesh) {
  constexpr int kAround = 120;
  const auto at = [&](double share, double u, double z) {
    const double angle = 2 * pi * u, r = hole + share * (radius(angle) - hole);
    return Eigen::Vector3d(r * std::cos(angle), r * std::sin(angle), z);
  };
  add_surface([&](double u, double v) { return at(1, u, low + v * (high - low)); }, kAround, 1, mesh);
  for (const double z : {low, high}) add_surface([&](double u, double v) { return at(v, u, z); }, kAround, 1, mesh);
  if (hole > 0) add_surface([&](double u, double v) { return at(0, u, low + v * (high - low)); }, kAround, 1, mesh);
}

void turn(const Eigen::Matrix3d& transform, PlyModel* mesh, std::size_t first) {
  for (std::size_t i = first; i < mesh->points.size(); ++i) {
    mesh->points[i] = (transform * mesh->points[i].cast<double>()).cast<float>();
  }
}

void shift(const Eigen::Vector3d& offset, PlyModel* mesh, std::size_t first) {
  for (std::size_t i = first; i < mesh->points.size(); ++i) mesh->points[i] += offset.cast<float>();
}

}  // namespace vantage
