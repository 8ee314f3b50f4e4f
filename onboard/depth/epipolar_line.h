#pragma once

#include <cmath>

#include "onboard/depth/host_device.h"

namespace vantage {

/// How the key frame's camera and another frame's camera stand to each other, and how well that is known. Both are the
/// same pinhole camera.
struct PairGeometry {
  float fx = 0, fy = 0, cx = 0, cy = 0;
  float rotation[9] = {};     ///< R_frame_key, row-major
  float translation[3] = {};  ///< t_frame_key, m
  /// Covariance of T_frame_key, row-major, perturbed on the left: exp(d) T with d = (shift in m, turn in rad) along the
  /// frame's axes.
  float covariance[36] = {};
  float misfit_variance_px2 = 0;  ///< of any place, along and across, beside the pose's: lens, rolling shutter
};

/// One pixel's epipolar line in the other frame, about the place that its mean inverse depth projects to.
///
/// Along the line, `s` pixels from `u0, v0` in the direction (ex, ey) of growing inverse depth. With q = R r the turned
/// ray of the pixel (r with z = 1) and t the translation, inverse depth p is seen at the projection of q + p t, and
///
///     s(p) = n (p - mean) / ((q_z + mean t_z) (q_z + p t_z)),   n = |(f_x (t_x q_z - q_x t_z), f_y (t_y q_z - q_y
///     t_z))|
struct EpipolarLine {
  float u0 = 0, v0 = 0;           ///< pixel of the mean
  float ex = 0, ey = 0;           ///< unit direction of growing inverse depth
  float n = 0;                    ///< length factor above, pixels * m
  float z0 = 0;                   ///< q_z + mean t_z: the point's depth over its depth in the key frame
  float tz = 0;                   ///< m
  float mean = 0;                 ///< 1/m
  float to_key[4] = {};           ///< d key pixel / d frame pixel for a patch that faces the key camera, row-major
  float variance_along_px2 = 0;   ///< of the match's place, from the pose's covariance, along the line
  float variance_across_px2 = 0;  ///< and across it

  /// d s / d p at the mean, pixels * m.
  VANTAGE_HOST_DEVICE float slope() const { return n / (z0 * z0); }

  /// Pixels along the line at inverse depth p. The point must be in front of the frame's camera.
  VANTAGE_HOST_DEVICE float along(float p) const { return n * (p - mean) / (z0 * (z0 + (p - mean) * tz)); }

  /// Inverse depth at s pixels along the line: the inverse of `along`.
  VANTAGE_HOST_DEVICE float inverse_depth(float s) const { return mean + s * z0 * z0 / (n - s * z0 * tz); }
};

/// The line of key pixel (x, y) with mean inverse depth `mean`. False when the point is not in front of the frame's
/// camera. Without parallax n is 0 and the direction is (1, 0).
VANTAGE_HOST_DEVICE inline bool epipolar_line(const PairGeometry& g, float x, float y, float mean, EpipolarLine* line) {
  const float rx = (x - g.cx) / g.fx, ry = (y - g.cy) / g.fy;
  const float* R = g.rotation;
  const float* t = g.translation;
  const float qx = R[0] * rx + R[1] * ry + R[2], qy = R[3] * rx + R[4] * ry + R[5], qz = R[6] * rx + R[7] * ry + R[8];
  const float px = qx + mean * t[0], py = qy + mean * t[1], pz = qz + mean * t[2];
  if (!(pz > 0.05F)) return false;
  const float iz = 1 / pz, nx = px * iz, ny = py * iz;
  line->u0 = g.fx * nx + g.cx;
  line->v0 = g.fy * ny + g.cy;
  line->mean = mean;
  line->z0 = pz;
  line->tz = t[2];
  const float lx = g.fx * (t[0] * qz - qx * t[2]), ly = g.fy * (t[1] * qz - qy * t[2]);
  line->n = std::sqrt(lx * lx + ly * ly);
  line->ex = line->n > 0 ? lx / line->n : 1;
  line->ey = line->n > 0 ? ly / line->n : 0;

  // d frame pixel / d key pixel with the inverse depth held: columns of R, projected.
  const float a00 = g.fx * iz * (R[0] - nx * R[6]) / g.fx, a01 = g.fx * iz * (R[1] - nx * R[7]) / g.fy;
  const float a10 = g.fy * iz * (R[3] - ny * R[6]) / g.fx, a11 = g.fy * iz * (R[4] - ny * R[7]) / g.fy;
  const float determinant = a00 * a11 - a01 * a10;
  if (!(std::fabs(determinant) > 1e-3F)) return false;
  line->to_key[0] = a11 / determinant;
  line->to_key[1] = -a01 / determinant;
  line->to_key[2] = -a10 / determinant;
  line->to_key[3] = a00 / determinant;

  // d pixel / d (shift, turn): the point in metres is (nx, ny, 1) * pz / mean.
  const float inverse_z = mean * iz;
  const float ju[6] = {g.fx * inverse_z, 0, -g.fx * nx * inverse_z, -g.fx * nx * ny, g.fx * (1 + nx * nx), -g.fx * ny};
  const float jv[6] = {0, g.fy * inverse_z, -g.fy * ny * inverse_z, -g.fy * (1 + ny * ny), g.fy * nx * ny, g.fy * nx};
  float ja[6], jc[6];
  for (int i = 0; i < 6; ++i) {
    ja[i] = line->ex * ju[i] + line->ey * jv[i];
    jc[i] = line->ex * jv[i] - line->ey * ju[i];
  }
  float along = 0, across = 0;
  for (int i = 0; i < 6; ++i) {
    float sa = 0, sc = 0;
    for (int k = 0; k < 6; ++k) {
      sa += g.covariance[6 * i + k] * ja[k];
      sc += g.covariance[6 * i + k] * jc[k];
    }
    along += ja[i] * sa;
    across += jc[i] * sc;
  }
  line->variance_along_px2 = along + g.misfit_variance_px2;
  line->variance_across_px2 = across + g.misfit_variance_px2;
  return true;
}

}  // namespace vantage
