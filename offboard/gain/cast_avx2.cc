// Eight rays at once. Compiled for AVX2.

#include <immintrin.h>

#include "offboard/gain/cast_block.h"

namespace vantage {
namespace {

constexpr std::size_t kLanes = 8;

double sum(__m256 value) {
  const __m256d pairs =
      _mm256_add_pd(_mm256_cvtps_pd(_mm256_castps256_ps128(value)), _mm256_cvtps_pd(_mm256_extractf128_ps(value, 1)));
  const __m128d two = _mm_add_pd(_mm256_castpd256_pd128(pairs), _mm256_extractf128_pd(pairs, 1));
  return _mm_cvtsd_f64(two) + _mm_cvtsd_f64(_mm_unpackhi_pd(two, two));
}

__m256i load(const std::int32_t* from) { return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(from)); }

/// Entries of lanes i and i + 4 side by side.
__m256 load_entries(const VisitEntry* table, unsigned code_low, unsigned code_high) {
  return _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_load_ps(&table[code_low & 0xff].pass)),
                              _mm_load_ps(&table[code_high & 0xff].pass), 1);
}

void cast_eight(const FieldView& field, const RayPacket<kRaysPerBlock>& packet, std::size_t first, RaySums* sums) {
  const VisitCode* codes = field.codes;
  const VisitEntry* table = field.table->entry.data();
  const std::array<std::int32_t, 3> strides = field.strides;
  const __m256i parked = _mm256_set1_epi32(field.parked_offset);
  const __m256i hits = _mm256_cmpgt_epi32(load(&packet.hits_region[first]), _mm256_setzero_si256());
  __m256i step[3], period[3], time[3];
  __m256i at = _mm256_set1_epi32(field.first_offset);
  for (std::size_t a = 0; a < 3; ++a) {
    const __m256i stride = _mm256_set1_epi32(strides[a]);
    time[a] = load(&packet.time[a][first]);
    period[a] = _mm256_and_si256(hits, load(&packet.period[a][first]));
    step[a] = _mm256_and_si256(hits, _mm256_mullo_epi32(load(&packet.direction[a][first]), stride));
    at = _mm256_add_epi32(at, _mm256_mullo_epi32(load(&packet.voxel[a][first]), stride));
  }
  at = _mm256_blendv_epi8(parked, at, hits);
  auto alive = static_cast<unsigned>(_mm256_movemask_ps(_mm256_castsi256_ps(hits)));
  const __m256 zero = _mm256_setzero_ps();
  __m256 visibility = _mm256_set1_ps(1), entropy = zero, occlusion_aware = zero, unobserved = zero, run = zero;
  __m256 rear_side_entropy = zero;
  __m256i proximity = _mm256_setzero_si256(), seen = _mm256_setzero_si256(), before = _mm256_setzero_si256();
  const __m256i entry_mask = _mm256_set1_epi32(kEntryMask), sentinel = _mm256_set1_epi32(field.table->sentinel());
  alignas(32) std::array<std::uint32_t, kLanes> offsets;
  for (std::int64_t visit = 1; alive != 0; ++visit) {
    _mm256_store_si256(reinterpret_cast<__m256i*>(offsets.data()), at);
    const unsigned c0 = codes[offsets[0]], c1 = codes[offsets[1]], c2 = codes[offsets[2]], c3 = codes[offsets[3]];
    const unsigned c4 = codes[offsets[4]], c5 = codes[offsets[5]], c6 = codes[offsets[6]], c7 = codes[offsets[7]];
    const __m256 e0 = load_entries(table, c0, c4), e1 = load_entries(table, c1, c5);
    const __m256 e2 = load_entries(table, c2, c6), e3 = load_entries(table, c3, c7);
    if ((c0 | c1 | c2 | c3 | c4 | c5 | c6 | c7) > 0x7f) {
      const __m256i code =
          _mm256_setr_epi32(static_cast<int>(c0), static_cast<int>(c1), static_cast<int>(c2), static_cast<int>(c3),
                            static_cast<int>(c4), static_cast<int>(c5), static_cast<int>(c6), static_cast<int>(c7));
      proximity = _mm256_add_epi32(proximity, _mm256_srli_epi32(code, kProximityShift));
      seen = _mm256_or_si256(seen, code);
    }
    // Entries of (pass, entropy, unknown entropy, flags) become columns, each half for itself.
    const __m256 low01 = _mm256_unpacklo_ps(e0, e1), high01 = _mm256_unpackhi_ps(e0, e1);
    const __m256 low23 = _mm256_unpacklo_ps(e2, e3), high23 = _mm256_unpackhi_ps(e2, e3);
    const __m256 pass = _mm256_shuffle_ps(low01, low23, 0x44), voxel_entropy = _mm256_shuffle_ps(low01, low23, 0xee);
    const __m256 unknown_entropy = _mm256_shuffle_ps(high01, high23, 0x44);
    const __m256 flags = _mm256_shuffle_ps(high01, high23, 0xee);
    entropy = _mm256_add_ps(entropy, voxel_entropy);
    occlusion_aware = _mm256_add_ps(occlusion_aware, _mm256_mul_ps(visibility, voxel_entropy));
    const __m256 visible_unknown = _mm256_mul_ps(visibility, unknown_entropy);
    unobserved = _mm256_add_ps(unobserved, visible_unknown);
    visibility = _mm256_mul_ps(visibility, pass);
    const auto stop = static_cast<unsigned>(_mm256_movemask_ps(flags));
    if (__builtin_expect(stop != 0, 0)) {
      const __m256i stopped = _mm256_srai_epi32(_mm256_castps_si256(flags), 31);
      const __m256i code =
          _mm256_setr_epi32(static_cast<int>(c0), static_cast<int>(c1), static_cast<int>(c2), static_cast<int>(c3),
                            static_cast<int>(c4), static_cast<int>(c5), static_cast<int>(c6), static_cast<int>(c7));
      const __m256i is_sentinel = _mm256_cmpeq_epi32(_mm256_and_si256(code, entry_mask), sentinel);
      const unsigned left = stop & static_cast<unsigned>(_mm256_movemask_ps(_mm256_castsi256_ps(is_sentinel)));
      const unsigned occupied = stop & ~left;
      // Bit 7 of the code becomes the sign.
      const auto occplane = static_cast<unsigned>(_mm256_movemask_ps(_mm256_castsi256_ps(_mm256_slli_epi32(seen, 24))));
      const auto unknown_before = static_cast<unsigned>(
          _mm256_movemask_ps(_mm256_castsi256_ps(_mm256_cmpgt_epi32(before, _mm256_setzero_si256()))));
      sums->visits += visit * __builtin_popcount(stop) - __builtin_popcount(left);
      sums->rear_side_voxels += __builtin_popcount(occupied & unknown_before);
      sums->ends_occupied += __builtin_popcount(occupied & ~occplane);
      const __m256i ended = _mm256_andnot_si256(is_sentinel, stopped);
      rear_side_entropy = _mm256_add_ps(rear_side_entropy, _mm256_and_ps(_mm256_castsi256_ps(ended), run));
      for (std::size_t a = 0; a < 3; ++a) {
        step[a] = _mm256_andnot_si256(stopped, step[a]);
        period[a] = _mm256_andnot_si256(stopped, period[a]);
      }
      at = _mm256_blendv_epi8(at, parked, stopped);
      alive &= ~stop;
    }
    run = _mm256_and_ps(_mm256_add_ps(run, visible_unknown), flags);
    before = _mm256_castps_si256(flags);
    const __m256i x_after_y = _mm256_cmpgt_epi32(time[0], time[1]), x_after_z = _mm256_cmpgt_epi32(time[0], time[2]);
    const __m256i y_after_z = _mm256_cmpgt_epi32(time[1], time[2]);
    const __m256i not_x = _mm256_or_si256(x_after_y, x_after_z);
    const __m256i go_y = _mm256_andnot_si256(y_after_z, x_after_y), go_z = _mm256_and_si256(x_after_z, y_after_z);
    time[0] = _mm256_add_epi32(time[0], _mm256_andnot_si256(not_x, period[0]));
    time[1] = _mm256_add_epi32(time[1], _mm256_and_si256(go_y, period[1]));
    time[2] = _mm256_add_epi32(time[2], _mm256_and_si256(go_z, period[2]));
    const __m256i forward =
        _mm256_or_si256(_mm256_andnot_si256(not_x, step[0]),
                        _mm256_or_si256(_mm256_and_si256(go_y, step[1]), _mm256_and_si256(go_z, step[2])));
    at = _mm256_add_epi32(at, forward);
  }
  alignas(32) std::array<std::int32_t, kLanes> lanes;
  _mm256_store_si256(reinterpret_cast<__m256i*>(lanes.data()), proximity);
  for (const std::int32_t steps : lanes) sums->proximity_steps += steps;
  sums->ends_occplane +=
      __builtin_popcount(static_cast<unsigned>(_mm256_movemask_ps(_mm256_castsi256_ps(_mm256_slli_epi32(seen, 24)))));
  sums->entropy += sum(entropy);
  sums->occlusion_aware += sum(occlusion_aware);
  sums->unobserved_voxel += sum(unobserved);
  sums->rear_side_entropy += sum(rear_side_entropy);
}

}  // namespace

RaySums cast_flat_avx2(const FieldView& field, const GridWalk& walk, const RayColumns& rays, std::size_t block) {
  RayPacket<kRaysPerBlock> packet;
  prepare_packet(walk, rays, block * kRaysPerBlock, &packet);
  RaySums sums;
  for (std::size_t first = 0; first < kRaysPerBlock; first += kLanes) cast_eight(field, packet, first, &sums);
  return sums;
}

}  // namespace vantage
