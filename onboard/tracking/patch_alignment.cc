#include "onboard/tracking/patch_alignment.h"

#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/LU>

namespace vantage::tracking {
namespace {

constexpr int kHalf = kPatch / 2;
constexpr int kPixels = kPatch * kPatch;
constexpr float kSmallStep = 0.03F;  // px; the residual place error of a converged step is its square
constexpr float kLargestMove = 12;   // px of this level: further away it is another feature
constexpr float kGainLow = 0.25F, kGainHigh = 4;

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
    for (int x = 0; x < kPatch; ++x) *out++ = w00 * p[x] + w10 * p[x + 1] + w01 * q[x] + w11 * q[x + 1];
  }
  return true;
}

/// Middle of the patch, and its zero-mean correlation with the values.
double correlation(const BorderedPatch& patch, const std::array<float, kPixels>& values) {
  float sum_a = 0, sum_b = 0, aa = 0, bb = 0, ab = 0;
  for (int y = 0; y < kPatch; ++y) {
    const float* a = &patch[static_cast<std::size_t>((y + 1) * kBorderedPatch + 1)];
    const float* b = &values[static_cast<std::size_t>(y * kPatch)];
    for (int x = 0; x < kPatch; ++x) {
      sum_a += a[x];
      sum_b += b[x];
      aa += a[x] * a[x];
      bb += b[x] * b[x];
      ab += a[x] * b[x];
    }
  }
  const double var_a = aa - sum_a * sum_a / kPixels, var_b = bb - sum_b * sum_b / kPixels;
  if (var_a < 1 || var_b < 1) return -1;
  return (ab - sum_a * sum_b / kPixels) / std::sqrt(var_a * var_b);
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

double correlation_at(const ImageView& image, const BorderedPatch& patch, double u, double v) {
  std::array<float, kPixels> values;
  if (!sample(image, static_cast<float>(u), static_cast<float>(v), &values)) return -1;
  return correlation(patch, values);
}

PatchAlignment align_patch(const ImageView& image, const BorderedPatch& patch, const Eigen::Vector2d& start,
                           const Eigen::Vector2d* normal, int iterations) {
  // Columns of K, so that the residual is K (place, gain, offset): the patch's gradients, its values about their mean,
  // and one. The offset then follows by itself: every other column is made zero-mean.
  std::array<float, kPixels> gx, gy, value, current;
  float mean = 0;
  for (int y = 0; y < kPatch; ++y) {
    const float* p = &patch[static_cast<std::size_t>((y + 1) * kBorderedPatch + 1)];
    for (int x = 0; x < kPatch; ++x) {
      const auto i = static_cast<std::size_t>(y * kPatch + x);
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
  Eigen::Matrix3f H = Eigen::Matrix3f::Zero();
  for (std::size_t i = 0; i < kPixels; ++i) {
    value[i] -= mean;
    gx[i] -= mean_x;
    gy[i] -= mean_y;
    H(0, 0) += gx[i] * gx[i];
    H(0, 1) += gx[i] * gy[i];
    H(0, 2) += gx[i] * value[i];
    H(1, 1) += gy[i] * gy[i];
    H(1, 2) += gy[i] * value[i];
    H(2, 2) += value[i] * value[i];
  }
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
    float mean_current = 0;
    for (std::size_t i = 0; i < kPixels; ++i) mean_current += current[i];
    mean_current /= kPixels;
    Eigen::Vector3f b = Eigen::Vector3f::Zero();
    for (std::size_t i = 0; i < kPixels; ++i) {
      const float residual = current[i] - mean_current - gain * value[i];
      b[0] += gx[i] * residual;
      b[1] += gy[i] * residual;
      b[2] += value[i] * residual;
    }
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
  result.correlation = correlation(patch, current);
  return result;
}

}  // namespace vantage::tracking
