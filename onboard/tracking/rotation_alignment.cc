#include "onboard/tracking/rotation_alignment.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "onboard/tracking/rigid_motion.h"

namespace vantage::tracking {
namespace {

constexpr int kLeastSide = 30;  // px of the small image
constexpr int kIterations = 12;
constexpr double kSmallStep = 2e-4;  // rad: a tenth of a pixel of the small image is 0.003
constexpr float kHuber = 25;         // grey levels

}  // namespace

RotationAlignment::RotationAlignment(const CameraModel& camera) : camera_(camera), level_(ImagePyramid::kLevels - 1) {
  while (level_ > 0 && (std::min(camera.width, camera.height) >> level_) < kLeastSide) --level_;
  const double scale = 1.0 / (1 << level_);
  for (int v = 1; v < (camera.height >> level_) - 1; ++v) {
    for (int u = 1; u < (camera.width >> level_) - 1; ++u) {
      Eigen::Vector3d ray;
      Eigen::Vector2d pixel;
      Eigen::Matrix<double, 2, 3> projection;
      if (!camera.unproject({to_base(u, level_), to_base(v, level_)}, &ray) ||
          !camera.project(ray, &pixel, &projection)) {
        continue;
      }
      samples_.push_back({ray.cast<float>(), (-scale * projection * skew(ray)).cast<float>(), u, v});
    }
  }
  jacobians_.resize(samples_.size());
}

RotationAlignment::Result RotationAlignment::align(const ImagePyramid& reference, const ImagePyramid& current,
                                                   const Eigen::Matrix3d& R_current_reference) {
  const ImageView from = reference.level(level_), to = current.level(level_);
  for (std::size_t i = 0; i < samples_.size(); ++i) {
    const Sample& sample = samples_[i];
    const std::uint8_t* p = from.row(sample.v) + sample.u;
    const Eigen::Vector2f gradient(0.5F * static_cast<float>(p[1] - p[-1]),
                                   0.5F * static_cast<float>(p[from.stride] - p[-from.stride]));
    for (int k = 0; k < 3; ++k) jacobians_[i][k] = sample.motion.col(k).dot(gradient);
    jacobians_[i][3] = static_cast<float>(p[0]);
    jacobians_[i][4] = 1;
  }
  Result result;
  result.R_current_reference = R_current_reference;
  float gain = 1, offset = 0;
  double best_cost = 1e30;
  Eigen::Matrix3d best = R_current_reference;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    Eigen::Matrix<float, 5, 5> H = Eigen::Matrix<float, 5, 5>::Zero();
    Eigen::Matrix<float, 5, 1> b = Eigen::Matrix<float, 5, 1>::Zero();
    double cost = 0, aa = 0, bb = 0, ab = 0, sa = 0, sb = 0;
    int visible = 0;
    for (std::size_t i = 0; i < samples_.size(); ++i) {
      const Eigen::Vector3d ray = result.R_current_reference * samples_[i].ray.cast<double>();
      Eigen::Vector2d pixel;
      if (!camera_.project(ray, &pixel)) continue;
      const double u = to_level(pixel.x(), level_), v = to_level(pixel.y(), level_);
      if (!to.inside(u, v, 0)) continue;
      const float grey = interpolate(to, static_cast<float>(u), static_cast<float>(v));
      const Eigen::Matrix<float, 5, 1>& k = jacobians_[i];
      const float residual = grey - gain * k[3] - offset;
      const float size = std::abs(residual);
      const float weight = size < kHuber ? 1 : kHuber / size;
      H.noalias() += weight * k * k.transpose();
      b += weight * residual * k;
      cost += size < kHuber ? 0.5 * size * size : kHuber * (size - 0.5 * kHuber);
      ++visible;
      sa += k[3];
      sb += grey;
      aa += k[3] * k[3];
      bb += grey * grey;
      ab += k[3] * grey;
    }
    if (visible < static_cast<int>(samples_.size()) / 5) break;
    cost /= visible;
    if (cost > best_cost) break;
    best_cost = cost;
    best = result.R_current_reference;
    const double variance_a = aa - sa * sa / visible, variance_b = bb - sb * sb / visible;
    result.correlation = (ab - sa * sb / visible) / std::sqrt(std::max(variance_a, 1.0) * std::max(variance_b, 1.0));
    Eigen::Matrix<double, 5, 5> A = H.cast<double>();
    A.diagonal().array() *= 1.0001;
    const Eigen::Matrix<double, 5, 1> step = A.ldlt().solve(b.cast<double>());
    if (!step.allFinite()) break;
    const Eigen::Vector3d omega = step.head<3>() / std::max(0.2F, gain);
    result.R_current_reference = result.R_current_reference * rotation_exp(-omega).toRotationMatrix();
    gain = std::clamp(gain + static_cast<float>(step[3]), 0.2F, 5.0F);
    offset += static_cast<float>(step[4]);
    if (omega.norm() < kSmallStep) break;
  }
  result.R_current_reference = best;
  return result;
}

}  // namespace vantage::tracking
