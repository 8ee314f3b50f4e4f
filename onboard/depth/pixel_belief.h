#pragma once

#include <cmath>

#include "onboard/depth/host_device.h"

namespace vantage {

/// What is believed of one pixel: its inverse depth is Gaussian, the share of matches that are right is Beta.
///
/// Inverse depth is that along the camera's z axis (1/m).
struct PixelBelief {
  float mean = 0;      ///< inverse depth, 1/m
  float variance = 0;  ///< of it
  float inliers = 0;   ///< Beta's a
  float outliers = 0;  ///< Beta's b

  VANTAGE_HOST_DEVICE float inlier_ratio() const { return inliers / (inliers + outliers); }
};

/// The belief after one more match at inverse depth `measured` with variance `variance` (Vogiatzis and Hernandez,
/// "Video-based, real-time multi-view stereo", 2011, Eqs. 18-26): the product of
///
///     ratio * N(measured; truth, variance) + (1 - ratio) * 1 / range
///
/// with the belief, brought back to Gaussian x Beta by equal first and second moments of both. `range` is the width of
/// inverse depths that a wrong match may fall on, 1/m.
VANTAGE_HOST_DEVICE inline PixelBelief updated_belief(const PixelBelief& belief, float measured, float variance,
                                                      float range) {
  const float a = belief.inliers, b = belief.outliers;
  const float joint = belief.variance * variance / (belief.variance + variance);     // s^2
  const float mean = joint * (belief.mean / belief.variance + measured / variance);  // m
  const float spread = belief.variance + variance;
  const float off = measured - belief.mean;
  const float normal = std::exp(-0.5F * off * off / spread) / std::sqrt(6.28318531F * spread);
  float c1 = a / (a + b) * normal;
  float c2 = b / (a + b) / range;
  const float total = c1 + c2;
  c1 /= total;
  c2 /= total;
  const float n1 = a + b + 1, n2 = a + b + 2;
  const float f = c1 * (a + 1) / n1 + c2 * a / n1;                                    // first moment of the ratio
  const float e = c1 * (a + 1) * (a + 2) / (n1 * n2) + c2 * a * (a + 1) / (n1 * n2);  // second moment
  PixelBelief next;
  next.mean = c1 * mean + c2 * belief.mean;
  // Var = E[x^2] - E[x]^2, about the new mean so that nothing cancels.
  const float d1 = mean - next.mean, d2 = belief.mean - next.mean;
  next.variance = c1 * (joint + d1 * d1) + c2 * (belief.variance + d2 * d2);
  next.inliers = (e - f) / (f - e / f);
  next.outliers = next.inliers * (1 - f) / f;
  return next;
}

/// The belief after a search that found no match.
VANTAGE_HOST_DEVICE inline PixelBelief missed_belief(PixelBelief belief) {
  belief.outliers += 1;
  return belief;
}

}  // namespace vantage
