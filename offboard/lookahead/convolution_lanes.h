#pragma once

// The sums in the compiler's vectors, as wide as an instruction set has them: included by one file for each.

#include <cstring>

#include "offboard/lookahead/convolution_kernel.h"

namespace vantage::convolution_kernel {

template <int kLanes>
struct Lanes {
  typedef float Vector __attribute__((vector_size(kLanes * sizeof(float))));
};

// Vectors are copied one by one: a copy of several at once goes by halves, which the processor can't forward to a load.

/// `kCount` voxels from number `first` on. Every output is summed in the same order, whatever kLanes is.
template <int kLanes, int kCount>
inline __attribute__((always_inline)) void sum_voxels(const Row& row, int first) {
  using Vector = typename Lanes<kLanes>::Vector;
  constexpr int kVectors = kGroup / kLanes;
  Vector sums[kCount][kVectors];
  for (int n = 0; n < kCount; ++n) {
    for (int v = 0; v < kVectors; ++v) std::memcpy(&sums[n][v], row.bias + v * kLanes, sizeof sums[n][v]);
  }
  const float* weight = row.weights;
  const std::ptrdiff_t next = row.in_next;
  const float* middle = row.in + first * next;
  for (int z = -row.reach; z <= row.reach; ++z) {
    for (int y = -row.reach; y <= row.reach; ++y) {
      for (int x = -row.reach; x <= row.reach; ++x) {
        const float* from = middle + x * row.in_step[0] + y * row.in_step[1] + z * row.in_step[2];
        for (int i = 0; i < row.inputs; ++i, weight += row.weight_step) {
          Vector weights[kVectors];
          for (int v = 0; v < kVectors; ++v) std::memcpy(&weights[v], weight + v * kLanes, sizeof weights[v]);
          for (int n = 0; n < kCount; ++n) {
            const float number = from[n * next + i];
            for (int v = 0; v < kVectors; ++v) sums[n][v] += number * weights[v];
          }
        }
      }
    }
  }
  for (int n = 0; n < kCount; ++n) {
    if (row.clip) {
      for (int v = 0; v < kVectors; ++v) {
        const Vector zero{};
        sums[n][v] = sums[n][v] > zero ? sums[n][v] : zero;
      }
    }
    float* out = row.out + (first + n) * row.out_next;
    for (int v = 0; v < kVectors; ++v) std::memcpy(out + v * kLanes, &sums[n][v], sizeof sums[n][v]);
  }
}

template <int kLanes>
inline __attribute__((always_inline)) void convolve_row(const Row& row) {
  constexpr int kTogether = 6;  // their sums fit into the registers
  int first = 0;
  for (; first + kTogether <= row.voxels; first += kTogether) sum_voxels<kLanes, kTogether>(row, first);
  for (; first < row.voxels; ++first) sum_voxels<kLanes, 1>(row, first);
}

}  // namespace vantage::convolution_kernel
