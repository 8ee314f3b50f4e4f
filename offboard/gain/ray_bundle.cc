#include "offboard/gain/ray_bundle.h"

#include <stdexcept>
#include <string>

namespace vantage {
namespace {

constexpr int kTile = 4;
constexpr int kMaxRays = 4096;  // each way

}  // namespace

RayBundle::RayBundle(const CameraModel& camera, int columns, int rows) {
  std::string why;
  if (!camera.valid(&why)) throw std::invalid_argument(why);
  if (columns < 1 || rows < 1 || columns > kMaxRays || rows > kMaxRays) {
    throw std::invalid_argument("a ray bundle needs 1 to 4096 columns and rows, not " + std::to_string(columns) +
                                " x " + std::to_string(rows));
  }
  const double cell_width = static_cast<double>(camera.width) / columns;
  const double cell_height = static_cast<double>(camera.height) / rows;
  directions_.reserve(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows));
  for (int tile_v = 0; tile_v < rows; tile_v += kTile) {
    for (int tile_u = 0; tile_u < columns; tile_u += kTile) {
      for (int v = tile_v; v < std::min(tile_v + kTile, rows); ++v) {
        for (int u = tile_u; u < std::min(tile_u + kTile, columns); ++u) {
          Eigen::Vector3d ray;
          if (camera.unproject({(u + 0.5) * cell_width - 0.5, (v + 0.5) * cell_height - 0.5}, &ray)) {
            directions_.push_back(ray);
          }
        }
      }
    }
  }
}

RayBundle::RayBundle(std::vector<Eigen::Vector3d> directions) : directions_(std::move(directions)) {
  for (Eigen::Vector3d& direction : directions_) {
    const double norm = direction.norm();
    if (!(norm > 0 && norm < std::numeric_limits<double>::infinity())) {
      throw std::invalid_argument("a ray's direction is zero or not finite");
    }
    direction /= norm;
  }
}

}  // namespace vantage
