#include "drivers/sim/camera_path.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "calib/files/input_error.h"
#include "calib/look_at.h"

namespace vantage::sim {
namespace {

using Eigen::AngleAxisd;
using Eigen::Isometry3d;
using Eigen::Vector3d;

constexpr double kTurn = 2 * std::numbers::pi;
constexpr double kDegree = std::numbers::pi / 180;

const Vector3d kEye(0.95, -0.75, 1.05);
const Vector3d kTarget(0.05, 0.05, 0.10);

/// `base` moved and turned in its own frame: t in metres along the camera's axes, r as a rotation vector.
Isometry3d moved(const Isometry3d& base, const Vector3d& t, const Vector3d& r) {
  Isometry3d motion = Isometry3d::Identity();
  if (r.norm() > 0) motion.linear() = AngleAxisd(r.norm(), r.normalized()).toRotationMatrix();
  motion.translation() = t;
  return base * motion;
}

/// From 0 to 1 within a unit of time, at rest before and after (Flash and Hogan 1985).
double minimum_jerk(double t) {
  t = std::clamp(t, 0.0, 1.0);
  return t * t * t * (10 - 15 * t + 6 * t * t);
}

}  // namespace

CameraPath camera_path_named(const std::string& name) {
  static const std::array<std::pair<const char*, CameraPath>, 7> kNames = {{{"hover", CameraPath::kHover},
                                                                            {"slide", CameraPath::kSlide},
                                                                            {"forward", CameraPath::kForward},
                                                                            {"circle", CameraPath::kCircle},
                                                                            {"rotate", CameraPath::kRotate},
                                                                            {"turn", CameraPath::kTurn},
                                                                            {"dash", CameraPath::kDash}}};
  for (const auto& [known, path] : kNames) {
    if (name == known) return path;
  }
  throw InputError("no camera path is called '" + name +
                   "'; there are hover, slide, forward, circle, rotate, turn, dash");
}

Isometry3d pose_on_path(CameraPath path, double time_s) {
  const Isometry3d base = look_at(kEye, kTarget);
  const auto wave = [time_s](double hertz, double phase) { return std::sin(kTurn * (hertz * time_s + phase)); };
  switch (path) {
    case CameraPath::kHover:
      return moved(base, {0.05 * wave(0.45, 0), 0.05 * wave(0.31, 0.25), 0.02 * wave(0.23, 0.1)},
                   2 * kDegree * Vector3d(wave(0.37, 0.3), wave(0.29, 0.6), wave(0.21, 0.8)));
    case CameraPath::kSlide:
      return moved(base, {0.10 * time_s, 0, 0}, Vector3d::Zero());
    case CameraPath::kForward:
      return moved(base, {0, 0, 0.10 * time_s}, Vector3d::Zero());
    case CameraPath::kCircle: {
      const double angle = kTurn * time_s / 20;
      return look_at({1.3 * std::cos(angle), 1.3 * std::sin(angle), 0.9}, {0, 0, 0.1});
    }
    case CameraPath::kRotate:
      return moved(base, Vector3d::Zero(),
                   15 * kDegree * Vector3d(0.5 * wave(0.2, 0), wave(0.15, 0), 0.3 * wave(0.1, 0)));
    case CameraPath::kTurn: {
      const double away = minimum_jerk(time_s / 2), turning = std::max(0.0, time_s - 2);
      return moved(base, {0.2 * away, 0, 0}, {0, 25 * kDegree * std::sin(kTurn * 0.28 * turning), 0});
    }
    case CameraPath::kDash: {
      const double phase = std::fmod(time_s, 2.0);
      const double away = minimum_jerk((phase - 0.6) / 0.4) - minimum_jerk((phase - 1.6) / 0.4);
      return moved(base, {0.25 * away, 0, 0}, {0, 6 * kDegree * away, 0});
    }
  }
  return base;
}

}  // namespace vantage::sim
