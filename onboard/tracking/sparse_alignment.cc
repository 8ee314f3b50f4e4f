#include "onboard/tracking/sparse_alignment.h"

#include <algorithm>
#include <limits>

#include <Eigen/Cholesky>

namespace vantage::tracking {
namespace {

constexpr int kSide = 4, kHalfSide = 2;
constexpr float kDegreesOfFreedom = 5;
constexpr float kLeastScale = 1;          // grey levels: below it is noise
constexpr double kSmallStep = 1e-5;       // rad, and m per m of distance
constexpr double kPixelNoise = 8;         // grey levels: what one residual's unit weight is worth against the prior
constexpr float kRegularisation = 1e-3F;  // of the gain, per point: keeps it at 1 where nothing has contrast

typedef float Float4 __attribute__((vector_size(16), aligned(16)));

}  // namespace

void SparseAlignment::prepare(const ImageView& reference, int level, std::span<const AlignmentPoint> points) {
  patches_.clear();
  const double scale = 1.0 / (1 << level);
  for (const AlignmentPoint& p : points) {
    const double u = to_level(p.pixel.x(), level), v = to_level(p.pixel.y(), level);
    if (!reference.inside(u, v, kHalfSide + 1)) continue;
    Eigen::Vector2d pixel;
    Eigen::Matrix<double, 2, 3> projection;
    if (!camera_.project(p.point, &pixel, &projection)) continue;
    const Eigen::Matrix<float, 2, 6> motion = (scale * projection * point_jacobian(p.point)).cast<float>();
    Patch& patch = patches_.emplace_back();
    patch.point = p.point;
    patch.hessian.setZero();
    int i = 0;
    for (int y = 0; y < kSide; ++y) {
      for (int x = 0; x < kSide; ++x, ++i) {
        const float pu = static_cast<float>(u) + static_cast<float>(x - kHalfSide);
        const float pv = static_cast<float>(v) + static_cast<float>(y - kHalfSide);
        const float gx = 0.5F * (interpolate(reference, pu + 1, pv) - interpolate(reference, pu - 1, pv));
        const float gy = 0.5F * (interpolate(reference, pu, pv + 1) - interpolate(reference, pu, pv - 1));
        Eigen::Map<Eigen::Matrix<float, 8, 1>> k(patch.jacobian[i]);
        k.head<6>() = motion.transpose() * Eigen::Vector2f(gx, gy);
        k[6] = interpolate(reference, pu, pv);
        k[7] = 1;
        patch.hessian.noalias() += k * k.transpose();
      }
    }
  }
  gradients_.resize(patches_.size());
}

double SparseAlignment::residuals(const ImageView& current, int level, const Eigen::Isometry3d& T_current_reference,
                                  double gain, double offset) {
  sorted_.clear();
  const float g = static_cast<float>(gain), o = static_cast<float>(offset);
  for (std::size_t n = 0; n < patches_.size(); ++n) {
    Patch& patch = patches_[n];
    Eigen::Vector2d pixel;
    patch.visible = camera_.project(T_current_reference * patch.point, &pixel);
    if (!patch.visible) continue;
    const double u = to_level(pixel.x(), level), v = to_level(pixel.y(), level);
    patch.visible = current.inside(u, v, kHalfSide + 1);
    if (!patch.visible) continue;
    const int iu = static_cast<int>(u), iv = static_cast<int>(v);
    const float du = static_cast<float>(u - iu), dv = static_cast<float>(v - iv);
    const float w00 = (1 - du) * (1 - dv), w10 = du * (1 - dv), w01 = (1 - du) * dv, w11 = du * dv;
    Float4 low = {0, 0, 0, 0}, high = {0, 0, 0, 0};
    float sum = 0;
    int i = 0;
    for (int y = 0; y < kSide; ++y) {
      const std::uint8_t* p = current.row(iv - kHalfSide + y) + iu - kHalfSide;
      const std::uint8_t* q = p + current.stride;
      for (int x = 0; x < kSide; ++x, ++i) {
        const float grey = w00 * p[x] + w10 * p[x + 1] + w01 * q[x] + w11 * q[x + 1];
        const float* k = patch.jacobian[i];
        const float r = grey - g * k[6] - o;
        const auto* k4 = reinterpret_cast<const Float4*>(k);
        low += r * k4[0];
        high += r * k4[1];
        sum += r * r;
      }
    }
    gradients_[n] << low[0], low[1], low[2], low[3], high[0], high[1], high[2], high[3];
    patch.rms = std::sqrt(sum / (kSide * kSide));
    sorted_.push_back(patch.rms);
  }
  if (sorted_.empty()) return std::numeric_limits<double>::infinity();
  const auto middle = sorted_.begin() + static_cast<std::ptrdiff_t>(sorted_.size() / 2);
  std::nth_element(sorted_.begin(), middle, sorted_.end());
  return *middle;
}

AlignmentResult SparseAlignment::align(const ImagePyramid& reference, std::span<const AlignmentPoint> points,
                                       const ImagePyramid& current, const Eigen::Isometry3d& T_current_reference,
                                       const MotionPrior& prior, const AlignmentOptions& options) {
  AlignmentResult result;
  result.T_current_reference = T_current_reference;
  Vector6d prior_information;
  prior_information << Eigen::Vector3d::Constant(1 / (prior.sigma_translation_m * prior.sigma_translation_m)),
      Eigen::Vector3d::Constant(1 / (prior.sigma_rotation_rad * prior.sigma_rotation_rad));
  prior_information *= kPixelNoise * kPixelNoise;

  for (int level = options.coarsest_level; level >= options.finest_level; --level) {
    prepare(reference.level(level), level, points);
    Eigen::Isometry3d best_motion = result.T_current_reference;
    double best_gain = result.gain, best_offset = result.offset;
    double best_cost = std::numeric_limits<double>::infinity();
    float scale = 0;
    for (int iteration = 0; iteration <= options.iterations; ++iteration) {
      const double median =
          residuals(current.level(level), level, result.T_current_reference, result.gain, result.offset);
      if (sorted_.size() < 4) break;
      // One scale for the whole level, from its start: with a moving one no cost could be compared with the last.
      if (iteration == 0) scale = std::max(kLeastScale, 1.4826F * static_cast<float>(median));
      Eigen::Matrix<float, 8, 8> H = Eigen::Matrix<float, 8, 8>::Zero();
      Eigen::Matrix<float, 8, 1> b = Eigen::Matrix<float, 8, 1>::Zero();
      double cost = 0;
      int visible = 0;
      for (std::size_t n = 0; n < patches_.size(); ++n) {
        const Patch& patch = patches_[n];
        if (!patch.visible) continue;
        const float ratio = patch.rms / scale;
        const float weight = (kDegreesOfFreedom + 1) / (kDegreesOfFreedom + ratio * ratio);
        H += weight * patch.hessian;
        b += weight * gradients_[n];
        cost += std::log1p(static_cast<double>(ratio * ratio / kDegreesOfFreedom));
        ++visible;
      }
      cost /= visible;
      const Vector6d deviation = motion_log(prior.T_current_reference.inverse() * result.T_current_reference);
      cost += deviation.cwiseProduct(prior_information).dot(deviation) /
              (static_cast<double>(visible * kSide * kSide) * scale * scale);
      if (cost > best_cost * (1 + 1e-6)) break;
      best_cost = cost;
      best_motion = result.T_current_reference;
      best_gain = result.gain;
      best_offset = result.offset;
      result.visible = visible;
      result.rms = median;
      if (iteration == options.iterations) break;
      // K columns are d grey / d motion at gain 1: the motion's part of the solution is divided by the gain below.
      Eigen::Matrix<double, 8, 8> A = H.cast<double>();
      Eigen::Matrix<double, 8, 1> rhs = b.cast<double>();
      A.topLeftCorner<6, 6>().diagonal() += prior_information;
      rhs.head<6>() += prior_information.cwiseProduct(deviation);
      A(6, 6) += kRegularisation * H(6, 6) / 100;
      const Eigen::Matrix<double, 8, 1> step = A.ldlt().solve(rhs);
      if (!step.allFinite()) break;
      const Vector6d xi = step.head<6>() / std::max(0.2, result.gain);
      result.T_current_reference = renormalized(result.T_current_reference * motion_exp(xi).inverse());
      result.gain = std::clamp(result.gain + step[6], 0.2, 5.0);
      result.offset += step[7];
      if (xi.cwiseAbs().maxCoeff() < kSmallStep) break;
    }
    result.T_current_reference = best_motion;
    result.gain = best_gain;
    result.offset = best_offset;
  }
  return result;
}

}  // namespace vantage::tracking
