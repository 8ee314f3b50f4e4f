#pragma once

#include <utility>
#include <vector>

#include "onboard/tracking/map.h"

namespace vantage::tracking {

/// Pairs (index into a, index into b) that are each other's nearest, differ by at most `most_bits`, and by clearly less
/// (a tenth) than the second nearest in b.
std::vector<std::pair<int, int>> match_descriptors(const std::vector<Descriptor>& a, const std::vector<Descriptor>& b,
                                                   int most_bits = 70);

}  // namespace vantage::tracking
