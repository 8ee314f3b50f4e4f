#include "calib/camera_model.h"

#include <cmath>

#include <Eigen/LU>

namespace vantage {
namespace {

using Vector2d = Eigen::Vector2d;
using Vector3d = Eigen::Vector3d;
using Matrix2d = Eigen::Matrix2d;
using Matrix23d = Eigen::Matrix<double, 2, 3>;
using Matrix32d = Eigen::Matrix<double, 3, 2>;

constexpr int kMaxIterations = 50;
constexpr double kConverged = 1e-14;  // in normalised image coordinates; about 1e-11 px
constexpr double kAxisRadius = 1e-9;  // nearer the optical axis the fisheye's limit formulas hold to double precision

/// Distorted normalised coordinates of ideal ones (x/z, y/z) and their derivative.
/// False where the radial factor no longer grows with the radius.
bool distort_radtan(const std::array<double, 5>& c, const Vector2d& ideal, Vector2d* distorted, Matrix2d* jacobian) {
  const double k1 = c[0], k2 = c[1], p1 = c[2], p2 = c[3], k3 = c[4];
  const double x = ideal.x(), y = ideal.y(), r2 = x * x + y * y;
  const double radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3));
  const double d_radial = k1 + r2 * (2 * k2 + r2 * 3 * k3);  // d radial / d r2
  if (radial + 2 * r2 * d_radial <= 0) return false;         // d (r radial) / d r
  *distorted = {x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
                y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y};
  const double cross = 2 * x * y * d_radial + 2 * p1 * x + 2 * p2 * y;
  *jacobian << radial + 2 * x * x * d_radial + 2 * p1 * y + 6 * p2 * x, cross,  //
      cross, radial + 2 * y * y * d_radial + 6 * p1 * y + 2 * p2 * x;
  return true;
}

/// Image radius of an angle to the optical axis, and its derivative (Kannala-Brandt).
double fisheye_radius(const std::array<double, 5>& c, double theta, double* derivative) {
  const double t2 = theta * theta;
  *derivative = 1 + t2 * (3 * c[0] + t2 * (5 * c[1] + t2 * (7 * c[2] + t2 * 9 * c[3])));
  return theta * (1 + t2 * (c[0] + t2 * (c[1] + t2 * (c[2] + t2 * c[3]))));
}

bool project_fisheye(const std::array<double, 5>& c, const Vector3d& point, Vector2d* distorted, Matrix23d* jacobian) {
  const double rho = std::hypot(point.x(), point.y()), z = point.z();
  if (rho < kAxisRadius * std::abs(z) || rho == 0) {
    if (z <= 0) return false;
    *distorted = point.head<2>() / z;
    *jacobian << 1 / z, 0, -point.x() / (z * z), 0, 1 / z, -point.y() / (z * z);
    return true;
  }
  const double theta = std::atan2(rho, z);
  double slope = 0;
  const double radius = fisheye_radius(c, theta, &slope);
  if (slope <= 0) return false;
  const Vector2d direction = point.head<2>() / rho;
  *distorted = radius * direction;
  // d theta = (z d rho - rho d z) / (rho^2 + z^2); the direction turns with (I - u u^T) / rho.
  const double squared = rho * rho + z * z;
  const Matrix2d along = direction * direction.transpose();
  jacobian->leftCols<2>() = slope * z / squared * along + radius / rho * (Matrix2d::Identity() - along);
  jacobian->col(2) = -slope * rho / squared * direction;
  return true;
}

bool unproject_fisheye(const std::array<double, 5>& c, const Vector2d& distorted, Vector3d* ray) {
  const double radius = distorted.norm();
  if (radius < kAxisRadius) {
    *ray = Vector3d(distorted.x(), distorted.y(), 1).normalized();
    return true;
  }
  double theta = std::min(radius, 1.5);
  for (int i = 0; i < kMaxIterations; ++i) {
    double slope = 0;
    const double error = fisheye_radius(c, theta, &slope) - radius;
    if (!(slope > 0)) return false;
    theta -= error / slope;
    if (std::abs(error) < kConverged) {
      if (!(theta > 0) || theta >= M_PI) return false;
      ray->head<2>() = std::sin(theta) / radius * distorted;
      ray->z() = std::cos(theta);
      return true;
    }
  }
  return false;
}

bool undistort_radtan(const std::array<double, 5>& c, const Vector2d& distorted, Vector2d* ideal) {
  Vector2d estimate = distorted, reached;
  Matrix2d jacobian;
  for (int i = 0; i < kMaxIterations; ++i) {
    if (!distort_radtan(c, estimate, &reached, &jacobian)) {
      if (i > 0) return false;
      estimate.setZero();  // the pixel itself lies outside the invertible disc: start from the axis
      continue;
    }
    const Vector2d error = reached - distorted;
    if (error.cwiseAbs().maxCoeff() < kConverged) {
      *ideal = estimate;
      return true;
    }
    if (std::abs(jacobian.determinant()) < 1e-12) return false;
    estimate -= jacobian.inverse() * error;
  }
  return false;
}

}  // namespace

bool CameraModel::valid(std::string* why) const {
  const auto fail = [why](const char* reason) {
    if (why != nullptr) *why = reason;
    return false;
  };
  if (width <= 0 || height <= 0) return fail("the camera's width and height must be positive");
  if (!(std::isfinite(fx) && std::isfinite(fy) && fx > 0 && fy > 0)) {
    return fail("the camera's focal lengths fx and fy must be finite and positive");
  }
  if (!(std::isfinite(cx) && std::isfinite(cy))) return fail("the camera's principal point must be finite");
  for (const double c : coefficients) {
    if (!std::isfinite(c)) return fail("a distortion coefficient is not finite");
  }
  return true;
}

bool CameraModel::contains(const Eigen::Vector2d& pixel) const {
  return pixel.x() >= -0.5 && pixel.y() >= -0.5 && pixel.x() < width - 0.5 && pixel.y() < height - 0.5;
}

bool CameraModel::project(const Eigen::Vector3d& point, Eigen::Vector2d* pixel, Matrix23d* jacobian) const {
  if (!point.allFinite()) return false;
  Vector2d normalised;
  Matrix23d d_point;
  if (distortion == Distortion::kEquidistant) {
    if (!project_fisheye(coefficients, point, &normalised, &d_point)) return false;
  } else {
    const double z = point.z();
    if (z <= 0) return false;
    const Vector2d ideal = point.head<2>() / z;
    d_point << 1 / z, 0, -ideal.x() / z, 0, 1 / z, -ideal.y() / z;
    normalised = ideal;
    if (distortion == Distortion::kRadTan) {
      Matrix2d d_ideal;
      if (!distort_radtan(coefficients, ideal, &normalised, &d_ideal)) return false;
      d_point = (d_ideal * d_point).eval();
    }
  }
  *pixel = {fx * normalised.x() + cx, fy * normalised.y() + cy};
  if (jacobian != nullptr) *jacobian = Vector2d(fx, fy).asDiagonal() * d_point;
  return true;
}

bool CameraModel::unproject(const Eigen::Vector2d& pixel, Eigen::Vector3d* ray, Matrix32d* jacobian) const {
  if (!pixel.allFinite()) return false;
  const Vector2d normalised((pixel.x() - cx) / fx, (pixel.y() - cy) / fy);
  Vector3d direction;
  if (distortion == Distortion::kEquidistant) {
    if (!unproject_fisheye(coefficients, normalised, &direction)) return false;
  } else {
    Vector2d ideal = normalised;
    if (distortion == Distortion::kRadTan && !undistort_radtan(coefficients, normalised, &ideal)) return false;
    direction = Vector3d(ideal.x(), ideal.y(), 1).normalized();
  }
  if (jacobian != nullptr) {
    // project(ray(pixel)) = pixel and |ray| = 1: [d project / d ray; ray^T] d ray / d pixel = [I; 0].
    Matrix23d d_project;
    Vector2d same;
    if (!project(direction, &same, &d_project)) return false;
    Eigen::Matrix3d system;
    system << d_project, direction.transpose();
    *jacobian = system.inverse().leftCols<2>();
  }
  *ray = direction;
  return true;
}

}  // namespace vantage
