#pragma once

#include <array>
#include <string>

#include <Eigen/Core>

namespace vantage {

/// How a lens bends the ideal pinhole image.
enum class Distortion {
  kNone,        ///< pinhole; coefficients unused
  kRadTan,      ///< Brown-Conrady: k1, k2, p1, p2, k3 (OpenCV's order)
  kEquidistant  ///< Kannala-Brandt fisheye: k1, k2, k3, k4 (the fifth unused)
};

/// A central camera: points of the camera frame (m; x right, y down, z forward) to pixels and back.
///
/// Pixel (0, 0) is the centre of the upper left pixel. Sources: Brown, "Close-range camera calibration", 1971 (radial-
/// tangential); Kannala and Brandt, "A generic camera model and calibration method", PAMI 2006 (equidistant).
///
///     CameraModel camera{.width = 752, .height = 480, .fx = 448, .fy = 448, .cx = 375.5, .cy = 239.5};
///     Eigen::Vector2d pixel;
///     if (camera.project({0.1, 0.0, 1.0}, &pixel)) ...
struct CameraModel {
  int width = 0;   ///< pixels
  int height = 0;  ///< pixels
  double fx = 0, fy = 0, cx = 0, cy = 0;
  Distortion distortion = Distortion::kNone;
  std::array<double, 5> coefficients{};

  /// False, with the reason in `why`, when the sizes or focal lengths are not positive or a number is not finite.
  bool valid(std::string* why = nullptr) const;

  /// Pixel of a point of the camera frame. False, and nothing written, when the point is not in front of the camera
  /// (z <= 0 for pinhole and radial-tangential; the camera's own centre for equidistant), or lies beyond the angle to
  /// which the radial polynomial grows, where two points would share a pixel. Does not test the image's bounds.
  /// `jacobian`, when given, receives d pixel / d point.
  bool project(const Eigen::Vector3d& point, Eigen::Vector2d* pixel,
               Eigen::Matrix<double, 2, 3>* jacobian = nullptr) const;

  /// Unit vector of the camera frame that a pixel looks along. False, and nothing written, when no ray projects there.
  /// `jacobian`, when given, receives d ray / d pixel.
  bool unproject(const Eigen::Vector2d& pixel, Eigen::Vector3d* ray,
                 Eigen::Matrix<double, 3, 2>* jacobian = nullptr) const;

  /// True when the pixel lies on the image (from -0.5 to width - 0.5, and so on).
  bool contains(const Eigen::Vector2d& pixel) const;

  bool operator==(const CameraModel&) const = default;
};

}  // namespace vantage
