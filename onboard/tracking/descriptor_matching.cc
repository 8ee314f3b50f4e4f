#include "onboard/tracking/descriptor_matching.h"

#include "onboard/tracking/descriptor.h"

namespace vantage::tracking {

std::vector<std::pair<int, int>> match_descriptors(const std::vector<Descriptor>& a, const std::vector<Descriptor>& b,
                                                   int most_bits) {
  std::vector<int> nearest_a(b.size(), -1), distance_a(b.size(), 257);
  std::vector<int> nearest_b(a.size(), -1);
  for (std::size_t i = 0; i < a.size(); ++i) {
    int best = 257, second = 257, at = -1;
    for (std::size_t j = 0; j < b.size(); ++j) {
      const int distance = hamming_distance(a[i], b[j]);
      if (distance < best) {
        second = best;
        best = distance;
        at = static_cast<int>(j);
      } else if (distance < second) {
        second = distance;
      }
      if (distance < distance_a[j]) {
        distance_a[j] = distance;
        nearest_a[j] = static_cast<int>(i);
      }
    }
    if (best <= most_bits && 10 * best <= 9 * second) nearest_b[i] = at;
  }
  std::vector<std::pair<int, int>> pairs;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const int j = nearest_b[i];
    if (j >= 0 && nearest_a[static_cast<std::size_t>(j)] == static_cast<int>(i))
      pairs.emplace_back(static_cast<int>(i), j);
  }
  return pairs;
}

}  // namespace vantage::tracking
