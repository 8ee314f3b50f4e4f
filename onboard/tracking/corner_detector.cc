#include "onboard/tracking/corner_detector.h"

#include <cmath>
#include <string>

#include <opencv2/features2d.hpp>

namespace vantage::tracking {
namespace {

cv::Mat mat_of(const ImageView& view) {
  // cv::Mat has no const view; FAST only reads.
  return cv::Mat(view.height, view.width, CV_8UC1, const_cast<std::uint8_t*>(view.data),
                 static_cast<std::size_t>(view.stride));
}

struct Grid {
  int cell_px, columns, rows;
  std::size_t index(double u, double v) const {
    const int column = std::min(columns - 1, static_cast<int>(u) / cell_px);
    const int row = std::min(rows - 1, static_cast<int>(v) / cell_px);
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns) + static_cast<std::size_t>(column);
  }
};

/// Strongest gradient of a cell on level 1, as an edgelet.
bool find_edgelet(const ImageView& image, int cell_u, int cell_v, const Grid& grid, const DetectorOptions& options,
                  Corner* edgelet) {
  constexpr int kLevel = 1;
  const int u0 = cell_u * grid.cell_px / 2, v0 = cell_v * grid.cell_px / 2, size = grid.cell_px / 2;
  float best = options.min_gradient * options.min_gradient;
  bool found = false;
  for (int v = v0; v < v0 + size; ++v) {
    for (int u = u0; u < u0 + size; ++u) {
      if (!image.inside(u, v, options.border_px)) continue;
      const std::uint8_t* p = image.row(v) + u;
      const float gx = 0.5F * static_cast<float>(p[1] - p[-1]);
      const float gy = 0.5F * static_cast<float>(p[image.stride] - p[-image.stride]);
      const float square = gx * gx + gy * gy;
      if (square <= best) continue;
      best = square;
      found = true;
      edgelet->pixel = {to_base(u, kLevel), to_base(v, kLevel)};
      edgelet->normal = Eigen::Vector2d(gx, gy).normalized();
    }
  }
  edgelet->level = kLevel;
  edgelet->score = std::sqrt(best);
  edgelet->edgelet = true;
  return found;
}

}  // namespace

bool DetectorOptions::valid(std::string* why) const {
  const auto fail = [why](const char* reason) {
    if (why != nullptr) *why = reason;
    return false;
  };
  if (cell_px < 8) return fail("cell_px must be at least 8");
  if (levels < 1 || levels > ImagePyramid::kLevels) return fail("levels must lie in 1 .. 5");
  if (fast_threshold < 1) return fail("fast_threshold must be positive");
  if (border_px < 7) return fail("border_px must be at least 7");
  return true;
}

float shi_tomasi_score(const ImageView& image, int u, int v) {
  float xx = 0, yy = 0, xy = 0;
  for (int y = v - 4; y < v + 4; ++y) {
    const std::uint8_t* p = image.row(y) + u - 4;
    for (int x = 0; x < 8; ++x) {
      const float dx = static_cast<float>(p[x + 1] - p[x - 1]);
      const float dy = static_cast<float>(p[x + image.stride] - p[x - image.stride]);
      xx += dx * dx;
      yy += dy * dy;
      xy += dx * dy;
    }
  }
  constexpr float kMean = 1.0F / (64 * 4);  // over 64 pixels; each central difference is twice the gradient
  xx *= kMean;
  yy *= kMean;
  xy *= kMean;
  return 0.5F * (xx + yy - std::sqrt((xx - yy) * (xx - yy) + 4 * xy * xy));
}

std::vector<Corner> detect_corners(const ImagePyramid& image, const std::vector<Eigen::Vector2d>& occupied,
                                   const DetectorOptions& options) {
  const Grid grid{options.cell_px, (image.width() + options.cell_px - 1) / options.cell_px,
                  (image.height() + options.cell_px - 1) / options.cell_px};
  const std::size_t cells = static_cast<std::size_t>(grid.columns) * static_cast<std::size_t>(grid.rows);
  std::vector<Corner> best(cells);
  std::vector<bool> taken(cells, false);
  for (const Eigen::Vector2d& pixel : occupied) {
    if (image.level(0).inside(pixel.x(), pixel.y(), 0)) taken[grid.index(pixel.x(), pixel.y())] = true;
  }
  std::vector<cv::KeyPoint> keypoints;
  for (int l = 0; l < options.levels; ++l) {
    const ImageView view = image.level(l);
    keypoints.clear();
    cv::FAST(mat_of(view), keypoints, options.fast_threshold, true);
    for (const cv::KeyPoint& keypoint : keypoints) {
      const int u = static_cast<int>(keypoint.pt.x), v = static_cast<int>(keypoint.pt.y);
      if (!view.inside(u, v, options.border_px)) continue;
      const Eigen::Vector2d pixel(to_base(u, l), to_base(v, l));
      const std::size_t cell = grid.index(pixel.x(), pixel.y());
      if (taken[cell]) continue;
      const float score = shi_tomasi_score(view, u, v);
      if (score < options.min_score || score <= best[cell].score) continue;
      best[cell] = {.pixel = pixel, .level = l, .score = score, .edgelet = false, .normal = {1, 0}};
    }
  }
  std::vector<Corner> corners;
  corners.reserve(cells);
  for (int v = 0; v < grid.rows; ++v) {
    for (int u = 0; u < grid.columns; ++u) {
      const std::size_t cell =
          static_cast<std::size_t>(v) * static_cast<std::size_t>(grid.columns) + static_cast<std::size_t>(u);
      if (taken[cell]) continue;
      if (best[cell].score > 0) {
        corners.push_back(best[cell]);
      } else if (Corner edgelet; options.edgelets && find_edgelet(image.level(1), u, v, grid, options, &edgelet)) {
        corners.push_back(edgelet);
      }
    }
  }
  return corners;
}

}  // namespace vantage::tracking
