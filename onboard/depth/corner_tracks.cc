#include "onboard/depth/corner_tracks.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Dense>

namespace vantage {
namespace {

constexpr int kRadius = 4;  // of a patch
constexpr int kSide = 2 * kRadius + 1;
constexpr int kSamples = kSide * kSide;
constexpr int kMargin = kRadius + 2;
constexpr int kIterations = 12;
constexpr float kSettled_px = 0.01F;
constexpr float kLeastCorrelation = 0.85F;
constexpr int kCornersPerChunk = 16;

using Patch = std::array<float, kSamples>;

float grey(const ImagePyramid::Level& image, int x, int y) {
  return static_cast<float>(image.pixels[static_cast<std::ptrdiff_t>(y) * image.stride + x]);
}

/// Smaller eigenvalue of the structure tensor of the 5 x 5 pixels about (x, y), per pixel.
float corner_score(const ImagePyramid::Level& image, int x, int y) {
  constexpr int kHalf = 2;
  float xx = 0, xy = 0, yy = 0;
  for (int v = y - kHalf; v <= y + kHalf; ++v) {
    for (int u = x - kHalf; u <= x + kHalf; ++u) {
      const float gx = 0.5F * (grey(image, u + 1, v) - grey(image, u - 1, v));
      const float gy = 0.5F * (grey(image, u, v + 1) - grey(image, u, v - 1));
      xx += gx * gx;
      xy += gx * gy;
      yy += gy * gy;
    }
  }
  const float mean = 0.5F * (xx + yy), off = 0.5F * (xx - yy);
  return (mean - std::sqrt(off * off + xy * xy)) / 25;
}

bool inside(const ImagePyramid::Level& image, const Eigen::Vector2f& centre) {
  return centre.x() >= kMargin && centre.y() >= kMargin && centre.x() < static_cast<float>(image.width - kMargin) &&
         centre.y() < static_cast<float>(image.height - kMargin);
}

/// The patch about `centre`, bilinear. \pre inside(image, centre)
void take_patch(const ImagePyramid::Level& image, const Eigen::Vector2f& centre, Patch* patch) {
  const float x0 = std::floor(centre.x()), y0 = std::floor(centre.y());
  const float fx = centre.x() - x0, fy = centre.y() - y0;
  const float w00 = (1 - fx) * (1 - fy), w10 = fx * (1 - fy), w01 = (1 - fx) * fy, w11 = fx * fy;
  float* out = patch->data();
  for (int v = -kRadius; v <= kRadius; ++v) {
    const std::uint8_t* row =
        image.pixels + (static_cast<std::ptrdiff_t>(y0) + v) * image.stride + static_cast<std::ptrdiff_t>(x0) - kRadius;
    for (int u = 0; u < kSide; ++u) {
      *out++ = w00 * row[u] + w10 * row[u + 1] + w01 * row[u + image.stride] + w11 * row[u + image.stride + 1];
    }
  }
}

/// The patch about `centre` with its samples `to_key` apart, bilinear. False where it reaches out of the image.
bool take_bent_patch(const ImagePyramid::Level& image, const Eigen::Vector2f& centre, const Eigen::Matrix2f& to_key,
                     const Eigen::Vector2f& shift, Patch* patch) {
  const Eigen::Vector2f middle = centre + to_key * shift;
  const Eigen::Vector2f reach = to_key.cwiseAbs() * Eigen::Vector2f::Constant(kRadius);
  if (!(middle.x() - reach.x() >= 0 && middle.y() - reach.y() >= 0 &&
        middle.x() + reach.x() < static_cast<float>(image.width - 1) &&
        middle.y() + reach.y() < static_cast<float>(image.height - 1))) {
    return false;
  }
  float* out = patch->data();
  for (int v = -kRadius; v <= kRadius; ++v) {
    for (int u = -kRadius; u <= kRadius; ++u) {
      const Eigen::Vector2f at = middle + to_key * Eigen::Vector2f(static_cast<float>(u), static_cast<float>(v));
      const auto x = static_cast<std::ptrdiff_t>(at.x()), y = static_cast<std::ptrdiff_t>(at.y());
      const float fx = at.x() - static_cast<float>(x), fy = at.y() - static_cast<float>(y);
      const std::uint8_t* p = image.pixels + y * image.stride + x;
      const float top = static_cast<float>(p[0]) + fx * static_cast<float>(p[1] - p[0]);
      const float bottom =
          static_cast<float>(p[image.stride]) + fx * static_cast<float>(p[image.stride + 1] - p[image.stride]);
      *out++ = top + fy * (bottom - top);
    }
  }
  return true;
}

/// Brings `patch` to mean 0 and norm 1; false when it is flat.
bool normalise(Patch* patch) {
  float sum = 0;
  for (const float value : *patch) sum += value;
  float squares = 0;
  for (float& value : *patch) {
    value -= sum / kSamples;
    squares += value * value;
  }
  if (squares < kSamples) return false;
  const float scale = 1 / std::sqrt(squares);
  for (float& value : *patch) value *= scale;
  return true;
}

/// One level's Gauss-Newton; positions are the level's. Both patches are normalised, which takes gain and offset out.
bool align_at_level(const ImagePyramid::Level& key, const ImagePyramid::Level& other, const Eigen::Vector2f& corner,
                    const Eigen::Matrix2f& to_key, Eigen::Vector2f* position, float* correlation) {
  Patch still, left, right, up, down;
  const Eigen::Vector2f x = Eigen::Vector2f::UnitX(), y = Eigen::Vector2f::UnitY();
  if (!take_bent_patch(key, corner, to_key, Eigen::Vector2f::Zero(), &still) ||
      !take_bent_patch(key, corner, to_key, -x, &left) || !take_bent_patch(key, corner, to_key, x, &right) ||
      !take_bent_patch(key, corner, to_key, -y, &up) || !take_bent_patch(key, corner, to_key, y, &down)) {
    return false;
  }
  const Patch raw = still;
  if (!normalise(&still)) return false;
  // Gradients in the normalised patch's units.
  float mean = 0;
  for (const float value : raw) mean += value / kSamples;
  float squares = 0;
  for (const float value : raw) squares += (value - mean) * (value - mean);
  const float scale = 0.5F / std::sqrt(squares);
  Patch gx, gy;
  float hxx = 0, hxy = 0, hyy = 0;
  for (std::size_t i = 0; i < kSamples; ++i) {
    gx[i] = scale * (right[i] - left[i]);
    gy[i] = scale * (down[i] - up[i]);
    hxx += gx[i] * gx[i];
    hxy += gx[i] * gy[i];
    hyy += gy[i] * gy[i];
  }
  const float determinant = hxx * hyy - hxy * hxy;
  if (!(determinant > 1e-6F * hxx * hyy) || !(determinant > 0)) return false;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    if (!inside(other, *position)) return false;
    Patch moving;
    take_patch(other, *position, &moving);
    if (!normalise(&moving)) return false;
    float bx = 0, by = 0, product = 0;
    for (std::size_t i = 0; i < kSamples; ++i) {
      const float error = still[i] - moving[i];
      bx += gx[i] * error;
      by += gy[i] * error;
      product += still[i] * moving[i];
    }
    *correlation = product;
    Eigen::Vector2f step((hyy * bx - hxy * by) / determinant, (hxx * by - hxy * bx) / determinant);
    if (!step.allFinite()) return false;
    if (step.norm() > 2) step *= 2 / step.norm();
    *position += step;
    if (step.norm() < kSettled_px) return true;
  }
  return true;
}

PatchPlace align_corner(const ImagePyramid& key, const ImagePyramid& other, const Eigen::Vector2f& corner,
                        const PatchPlace& guess) {
  PatchPlace place = guess;
  place.found = false;
  float correlation = -1;
  for (int l = ImagePyramid::kLevels - 1; l >= 0; --l) {
    const float scale = 1.0F / static_cast<float>(1 << l);
    const auto to_level = [scale](const Eigen::Vector2f& full) -> Eigen::Vector2f {
      return ((full.array() + 0.5F) * scale - 0.5F).matrix();
    };
    Eigen::Vector2f position = to_level(place.position);
    const bool aligned =
        align_at_level(key.level(l), other.level(l), to_level(corner), guess.to_key, &position, &correlation);
    // A coarse level may fail at the image's edge or for want of texture; the finest must not.
    if (aligned) place.position = ((position.array() + 0.5F) / scale - 0.5F).matrix();
    if (l == 0) place.found = aligned && correlation > kLeastCorrelation && inside(other.level(0), place.position);
  }
  return place;
}

}  // namespace

void find_corners(const ImagePyramid& image, int most, std::vector<Eigen::Vector2f>* corners) {
  constexpr float kLeastScore = 12;  // grey levels squared a pixel: three times what noise of two levels makes
  const ImagePyramid::Level full = image.level(0);
  corners->clear();
  const double cell = std::sqrt(static_cast<double>(full.width) * full.height / most);
  const int columns = std::max(1, static_cast<int>(full.width / cell));
  const int rows = std::max(1, static_cast<int>(full.height / cell));
  // Far enough from the edge that the coarsest level still holds the patch.
  const int edge = kMargin + 4;
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < columns; ++c) {
      float best = kLeastScore;
      Eigen::Vector2f place(-1, -1);
      for (int y = std::max(edge, r * full.height / rows);
           y < std::min(full.height - edge, (r + 1) * full.height / rows); y += 2) {
        for (int x = std::max(edge, c * full.width / columns);
             x < std::min(full.width - edge, (c + 1) * full.width / columns); x += 2) {
          const float score = corner_score(full, x, y);
          if (score > best) {
            best = score;
            place = Eigen::Vector2f(static_cast<float>(x), static_cast<float>(y));
          }
        }
      }
      if (place.x() >= 0) corners->push_back(place);
    }
  }
}

void align_corners(const ImagePyramid& key, const ImagePyramid& other, const std::vector<Eigen::Vector2f>& corners,
                   WorkerPool* pool, std::vector<PatchPlace>* places) {
  const int chunks = (static_cast<int>(corners.size()) + kCornersPerChunk - 1) / kCornersPerChunk;
  pool->run(chunks, [&](int chunk) {
    const std::size_t begin = static_cast<std::size_t>(chunk) * kCornersPerChunk;
    const std::size_t end = std::min(corners.size(), begin + kCornersPerChunk);
    for (std::size_t i = begin; i < end; ++i) (*places)[i] = align_corner(key, other, corners[i], (*places)[i]);
  });
}

}  // namespace vantage
