#include "onboard/tracking/patch_alignment.h"

#include <cmath>
#include <cstring>

#include <Eigen/Cholesky>
#include <Eigen/LU>

namespace vantage::tracking {
namespace {

constexpr int kHalf = kPatch / 2;
constexpr int kPixels = kPatch * kPatch;
constexpr float kSmallStep = 0.03F;  // px; the residual place error of a converged step is its square
constexpr float kLargestMove = 12;   // px of this level: further away it is another feature
constexpr float kGainLow = 0.25F, kGainHigh = 4;

/// Four values side by side. A GCC and Clang vector: the same sums, in the same order, on every machine.
typedef float Float4 __attribute__((vector_size(16)));
typedef std::uint8_t Byte4 __attribute__((vector_size(4)));

Float4 load(const std::uint8_t* p) {
  Byte4 bytes;
  std::memcpy(&bytes, p, sizeof bytes);
  return __builtin_convertvector(bytes, Float4);
}

Float4 load(const float* p) {
  Float4 values;
  std::memcpy(&values, p, sizeof values);
  return values;
}

float sum(Float4 v) { return (v[0] + v[1]) + (v[2] + v[3]); }

/// Values of the image under the patch whose middle is at (u, v).
bool sample(const ImageView& image, float u, float v, std::array<float, kPixels>* values) {
  if (!(u >= kHalf && v >= kHalf && u < static_cast<float>(image.width - kHalf - 1) &&
        v < static_cast<float>(image.height - kHalf - 1))) {
    return false;
  }
  const int iu = static_cast<int>(std::floor(u)), iv = static_cast<int>(std::floor(v));
  const float du = u - static_cast<float>(iu), dv = v - static_cast<float>(iv);
  const float w00 = (1 - du) * (1 - dv), w10 = du * (1 - dv), w01 = (1 - du) * dv, w11 = du * dv;
  float* out = values->data();
  for (int y = 0; y < kPatch; ++y) {
    const std::uint8_t* p = image.row(iv - kHalf + y) + iu - kHalf;
    const std::uint8_t* q = p + image.stride;
    for (int x = 0; x < kPatch; x += 4, out += 4) {
      const Float4 row = w00 * load(p + x) + w10 * load(p + x + 1) + w01 * load(q + x) + w11 * load(q + x + 1);
      std::memcpy(out, &row, sizeof row);
    }
  }
  return true;
}

/// What a correlation needs of its patch: the middle's values less their mean, over the root of their square sum.
bool normalise(const BorderedPatch& patch, std::array<float, kPixels>* normalised) {
  float mean = 0, square = 0;
  for (std::size_t y = 0; y < kPatch; ++y) {
    for (std::size_t x = 0; x < kPatch; ++x) {
      (*normalised)[y * kPatch + x] = patch[(y + 1) * kBorderedPatch + x + 1];
      mean += (*normalised)[y * kPatch + x];
    }
  }
  mean /= kPixels;
  for (float& value : *normalised) {
    value -= mean;
    square += value * value;
  }
  if (square < 1) return false;
  for (float& value : *normalised) value /= std::sqrt(square);
  return true;
}

/// Zero-mean correlation of a normalised patch with values.
double correlation(const std::array<float, kPixels>& normalised, const std::array<float, kPixels>& values) {
  Float4 b = {0, 0, 0, 0}, bb = {0, 0, 0, 0}, ab = {0, 0, 0, 0};
  for (std::size_t i = 0; i < kPixels; i += 4) {
    const Float4 value = load(&values[i]);
    b += value;
    bb += value * value;
    ab += value * load(&normalised[i]);
  }
  const double variance = static_cast<double>(sum(bb)) - static_cast<double>(sum(b)) * sum(b) / kPixels;
  return variance < 1 ? -1 : sum(ab) / std::sqrt(variance);
}

}  // namespace

bool cut_patch(const ImageView& image, const Eigen::Vector2d& pixel, BorderedPatch* patch) {
  return warp_patch(image, pixel, Eigen::Matrix2d::Identity(), patch);
}

bool warp_patch(const ImageView& image, const Eigen::Vector2d& pixel, const Eigen::Matrix2d& A_reference_current,
                BorderedPatch* patch) {
  constexpr int kFirst = -(kHalf + 1), kLast = kHalf;
  for (const int y : {kFirst, kLast}) {  // an affine image of a square is inside when its corners are
    for (const int x : {kFirst, kLast}) {
      const Eigen::Vector2d corner = pixel + A_reference_current * Eigen::Vector2d(x, y);
      if (!image.inside(corner.x(), corner.y(), 0)) return false;
    }
  }
  const Eigen::Matrix2f A = A_reference_current.cast<float>();
  const Eigen::Vector2f centre = pixel.cast<float>();
  float* out = patch->data();
  for (int y = kFirst; y <= kLast; ++y) {
    Eigen::Vector2f at = centre + A * Eigen::Vector2f(static_cast<float>(kFirst), static_cast<float>(y));
    for (int x = kFirst; x <= kLast; ++x, at += A.col(0)) {
      *out++ = interpolate(image, std::max(at.x(), 0.0F), std::max(at.y(), 0.0F));
    }
  }
  return true;
}

PatchCorrelation::PatchCorrelation(const BorderedPatch& patch) : contrast_(normalise(patch, &normalised_)) {}

double PatchCorrelation::at(const ImageView& image, int u, int v) const {
  if (!contrast_ || u < kHalf || v < kHalf || u > image.width - kHalf || v > image.height - kHalf) return -1;
  Float4 b = {0, 0, 0, 0}, bb = {0, 0, 0, 0}, ab = {0, 0, 0, 0};
  const float* a = normalised_.data();
  for (int y = -kHalf; y < kHalf; ++y) {
    const std::uint8_t* p = image.row(v + y) + u - kHalf;
    for (int x = 0; x < kPatch; x += 4, a += 4) {
      const Float4 value = load(p + x);
      b += value;
      bb += value * value;
      ab += value * load(a);
    }
  }
  const double variance = static_cast<double>(sum(bb)) - static_cast<double>(sum(b)) * sum(b) / kPixels;
  return variance < 1 ? -1 : sum(ab) / std::sqrt(variance);
}

PatchAlignment align_patch(const ImageView& image, const BorderedPatch& patch, const Eigen::Vector2d& start,
                           const Eigen::Vector2d* normal, int iterations) {
  // Columns of K, so that the residual is K (place, gain, offset): the patch's gradients, its values about their mean,
  // and one. The offset then follows by itself: every other column is made zero-mean.
  std::array<float, kPixels> gx, gy, value, current;
  float mean = 0;
  for (std::size_t y = 0; y < kPatch; ++y) {
    const float* p = &patch[(y + 1) * kBorderedPatch + 1];
    for (int x = 0; x < kPatch; ++x) {
      const std::size_t i = y * kPatch + static_cast<std::size_t>(x);
      gx[i] = 0.5F * (p[x + 1] - p[x - 1]);
      gy[i] = 0.5F * (p[x + kBorderedPatch] - p[x - kBorderedPatch]);
      value[i] = p[x];
      mean += p[x];
    }
  }
  mean /= kPixels;
  const float nx = normal ? static_cast<float>((*normal).x()) : 0, ny = normal ? static_cast<float>((*normal).y()) : 0;
  float mean_x = 0, mean_y = 0;
  for (std::size_t i = 0; i < kPixels; ++i) {
    if (normal) {
      gx[i] = nx * gx[i] + ny * gy[i];
      gy[i] = 0;
    }
    mean_x += gx[i];
    mean_y += gy[i];
  }
  mean_x /= kPixels;
  mean_y /= kPixels;
  Float4 xx = {0, 0, 0, 0}, xy = xx, xg = xx, yy = xx, yg = xx, gg = xx;
  for (std::size_t i = 0; i < kPixels; i += 4) {
    const Float4 x = load(&gx[i]) - mean_x, y = load(&gy[i]) - mean_y, g = load(&value[i]) - mean;
    std::memcpy(&gx[i], &x, sizeof x);
    std::memcpy(&gy[i], &y, sizeof y);
    std::memcpy(&value[i], &g, sizeof g);
    xx += x * x;
    xy += x * y;
    xg += x * g;
    yy += y * y;
    yg += y * g;
    gg += g * g;
  }
  Eigen::Matrix3f H;
  H << sum(xx), sum(xy), sum(xg), 0, sum(yy), sum(yg), 0, 0, sum(gg);
  if (normal) H(1, 1) = 1;
  H(1, 0) = H(0, 1);
  H(2, 0) = H(0, 2);
  H(2, 1) = H(1, 2);
  PatchAlignment result;
  const float determinant = H.determinant();
  if (!(determinant > 1e-3F * H(0, 0) * std::max(H(1, 1), 1.0F) * std::max(H(2, 2), 1.0F) * 1e-2F)) return result;
  const Eigen::Matrix3f H_inverse = H.inverse();

  const float start_u = static_cast<float>(start.x()), start_v = static_cast<float>(start.y());
  float u = start_u, v = start_v, gain = 1;
  for (int iteration = 0; iteration < iterations; ++iteration) {
    if (!sample(image, u, v, &current)) return result;
    Float4 total = {0, 0, 0, 0}, bx = total, by = total, bg = total;
    for (std::size_t k = 0; k < kPixels; k += 4) total += load(&current[k]);
    const float mean_current = sum(total) / kPixels;
    for (std::size_t k = 0; k < kPixels; k += 4) {
      const Float4 g = load(&value[k]), residual = load(&current[k]) - mean_current - gain * g;
      bx += load(&gx[k]) * residual;
      by += load(&gy[k]) * residual;
      bg += g * residual;
    }
    const Eigen::Vector3f b(sum(bx), sum(by), sum(bg));
    const Eigen::Vector3f step = H_inverse * b;
    gain = std::min(std::max(gain + step[2], kGainLow), kGainHigh);
    // The step moves the patch under the image: the image's place moves the other way.
    const float along = step[0] / gain, across = step[1] / gain;
    const float move_u = normal ? along * nx : along, move_v = normal ? along * ny : across;
    u -= move_u;
    v -= move_v;
    if (!(std::abs(u - start_u) < kLargestMove && std::abs(v - start_v) < kLargestMove)) return result;
    if (move_u * move_u + move_v * move_v < kSmallStep * kSmallStep) {
      result.converged = true;
      break;
    }
  }
  result.pixel = Eigen::Vector2d(u, v);
  if (!sample(image, u, v, &current)) {
    result.converged = false;
    return result;
  }
  std::array<float, kPixels> normalised;
  if (normalise(patch, &normalised)) result.correlation = correlation(normalised, current);
  return result;
}

}  // namespace vantage::tracking
