#pragma once

#include "onboard/tracking/map.h"

namespace vantage::tracking {

/// 256 comparisons of smoothed grey values around a pixel of one level, turned with the patch's own direction, its
/// intensity centroid's (oriented BRIEF: Calonder et al. 2010, Rublee et al. 2011). The pattern is drawn from a
/// Gaussian with a fixed seed. False when the patch (17 px to every side) reaches out of the image.
bool describe(const ImageView& image, double u, double v, Descriptor* descriptor);

/// Number of bits in which two descriptors differ, 0 to 256; two unrelated ones differ by 128 +- 8 or more often less.
int hamming_distance(const Descriptor& a, const Descriptor& b);

}  // namespace vantage::tracking
