#pragma once

// For the files compiled for AVX-512 alone: everything has internal linkage.

#include <array>
#include <cstdint>

#include <immintrin.h>

namespace vantage {
namespace {

/// A column of the visit table in kRegisters pairs of registers, 32 entries each.
template <int kPairs>
struct Column {
  __m512 low[kPairs], high[kPairs];

  explicit Column(const float* values) {
    for (int i = 0; i < kPairs; ++i) {
      low[i] = _mm512_loadu_ps(values + 32 * i);
      high[i] = _mm512_loadu_ps(values + 32 * i + 16);
    }
  }
  /// `entry` by its low 7 bits; the bits above must not matter: vpermi2ps reads five.
  __m512 at(__m512i entry) const {
    __m512 value = _mm512_permutex2var_ps(low[0], entry, high[0]);
    if constexpr (kPairs >= 2) {
      const __mmask16 bit5 = _mm512_test_epi32_mask(entry, _mm512_set1_epi32(32));
      value = _mm512_mask_mov_ps(value, bit5, _mm512_permutex2var_ps(low[1], entry, high[1]));
      if constexpr (kPairs == 4) {
        __m512 upper = _mm512_permutex2var_ps(low[2], entry, high[2]);
        upper = _mm512_mask_mov_ps(upper, bit5, _mm512_permutex2var_ps(low[3], entry, high[3]));
        value = _mm512_mask_mov_ps(value, _mm512_test_epi32_mask(entry, _mm512_set1_epi32(64)), upper);
      }
    }
    return value;
  }
};

inline double sum(__m512 value) {
  return _mm512_reduce_add_pd(
      _mm512_add_pd(_mm512_cvtps_pd(_mm512_castps512_ps256(value)), _mm512_cvtps_pd(_mm512_extractf32x8_ps(value, 1))));
}

inline __m512i load(const std::array<std::int32_t, 16>& from) { return _mm512_load_si512(from.data()); }

}  // namespace
}  // namespace vantage
