// Sixteen rays at once, the visit table in registers. Compiled for AVX-512 F, BW, DQ and VL.

#include <immintrin.h>

#include "offboard/gain/avx512_columns.h"
#include "offboard/gain/cast_block.h"

namespace vantage {
namespace {

template <int kPairs>
RaySums cast(const FieldView& field, const RayPacket<16>& packet) {
  const VisitTable& table = *field.table;
  const std::array<std::int32_t, 3> strides = field.strides;
  const char* codes = reinterpret_cast<const char*>(field.codes) - 2;  // the code is the upper half of 32 bits
  const Column<kPairs> pass_column(table.pass.data()), entropy_column(table.entropy.data());
  const __m512i unknown_end = _mm512_set1_epi32(table.unknown_end), stop_begin = _mm512_set1_epi32(table.stop_begin);
  const __m512i sentinel = _mm512_set1_epi32(table.sentinel()), parked = _mm512_set1_epi32(field.parked_offset);
  const __m512i entry_mask = _mm512_set1_epi32(kEntryMask);
  const __m512i occplane_bit = _mm512_set1_epi32(static_cast<int>(kOccplaneBit) << 16);
  __m512i step[3], period[3], time[3];
  __m512i at = _mm512_set1_epi32(field.first_offset);
  __mmask16 alive = _mm512_test_epi32_mask(load(packet.hits_region), load(packet.hits_region));
  for (std::size_t a = 0; a < 3; ++a) {
    const __m512i stride = _mm512_set1_epi32(strides[a]);
    time[a] = load(packet.time[a]);
    period[a] = _mm512_maskz_mov_epi32(alive, load(packet.period[a]));
    step[a] = _mm512_maskz_mullo_epi32(alive, load(packet.direction[a]), stride);
    at = _mm512_add_epi32(at, _mm512_mullo_epi32(load(packet.voxel[a]), stride));
  }
  at = _mm512_mask_mov_epi32(parked, alive, at);

  const __m512 zero = _mm512_setzero_ps();
  __m512 visibility = _mm512_set1_ps(1), entropy = zero, occlusion_aware = zero, unobserved = zero, run = zero;
  __m512 rear_side_entropy = zero;
  __m512i proximity = _mm512_setzero_si512(), seen = _mm512_setzero_si512();
  __mmask16 before_unknown = 0;
  RaySums sums;
  for (std::int64_t visit = 1; alive != 0; ++visit) {
    const __m512i code = _mm512_i32gather_epi32(at, codes, 2);
    const __m512i shifted = _mm512_srli_epi32(code, 16), entry = _mm512_and_si512(shifted, entry_mask);
    const __m512 pass = pass_column.at(entry), voxel_entropy = entropy_column.at(entry);
    const __mmask16 unknown = _mm512_cmplt_epi32_mask(entry, unknown_end);
    const __mmask16 stop = _mm512_cmpge_epi32_mask(entry, stop_begin);
    const __m512 visible = _mm512_mul_ps(visibility, voxel_entropy);
    entropy = _mm512_add_ps(entropy, voxel_entropy);
    occlusion_aware = _mm512_add_ps(occlusion_aware, visible);
    unobserved = _mm512_mask_add_ps(unobserved, unknown, unobserved, visible);
    visibility = _mm512_mul_ps(visibility, pass);
    if (__builtin_expect(stop != 0, 0)) {
      const __mmask16 left = _mm512_mask_cmpeq_epi32_mask(stop, entry, sentinel);
      const __mmask16 occupied = static_cast<__mmask16>(stop & ~left);
      const __mmask16 occplane = _mm512_test_epi32_mask(seen, occplane_bit);
      sums.visits += visit * __builtin_popcount(stop) - __builtin_popcount(left);
      sums.rear_side_voxels += __builtin_popcount(occupied & before_unknown);
      sums.ends_occupied += __builtin_popcount(occupied & ~static_cast<unsigned>(occplane));
      rear_side_entropy = _mm512_mask_add_ps(rear_side_entropy, occupied, rear_side_entropy, run);
      for (std::size_t a = 0; a < 3; ++a) {
        step[a] = _mm512_mask_mov_epi32(step[a], stop, _mm512_setzero_si512());
        period[a] = _mm512_mask_mov_epi32(period[a], stop, _mm512_setzero_si512());
      }
      at = _mm512_mask_mov_epi32(at, stop, parked);
      alive = static_cast<__mmask16>(alive & ~stop);
    }
    run = _mm512_maskz_add_ps(unknown, run, visible);
    before_unknown = unknown;
    seen = _mm512_or_si512(seen, code);
    proximity = _mm512_add_epi32(proximity, _mm512_srli_epi32(code, 24));
    const __mmask16 x_after_y = _mm512_cmpgt_epi32_mask(time[0], time[1]);
    const __mmask16 x_after_z = _mm512_cmpgt_epi32_mask(time[0], time[2]);
    const __mmask16 y_after_z = _mm512_cmpgt_epi32_mask(time[1], time[2]);
    const __mmask16 go_x = _knot_mask16(_kor_mask16(x_after_y, x_after_z));
    const __mmask16 go_y = _kandn_mask16(y_after_z, x_after_y);
    const __mmask16 go_z = _kand_mask16(x_after_z, y_after_z);
    time[0] = _mm512_mask_add_epi32(time[0], go_x, time[0], period[0]);
    at = _mm512_mask_add_epi32(at, go_x, at, step[0]);
    time[1] = _mm512_mask_add_epi32(time[1], go_y, time[1], period[1]);
    at = _mm512_mask_add_epi32(at, go_y, at, step[1]);
    time[2] = _mm512_mask_add_epi32(time[2], go_z, time[2], period[2]);
    at = _mm512_mask_add_epi32(at, go_z, at, step[2]);
  }
  sums.proximity_steps = _mm512_reduce_add_epi32(proximity);
  sums.ends_occplane = __builtin_popcount(_mm512_test_epi32_mask(seen, occplane_bit));
  sums.entropy = sum(entropy);
  sums.occlusion_aware = sum(occlusion_aware);
  sums.unobserved_voxel = sum(unobserved);
  sums.rear_side_entropy = sum(rear_side_entropy);
  return sums;
}

}  // namespace

RaySums cast_flat_avx512(const FieldView& field, const GridWalk& walk, const RayColumns& rays, std::size_t block) {
  RayPacket<kRaysPerBlock> packet;
  prepare_packet(walk, rays, block * kRaysPerBlock, &packet);
  if (field.table->size <= 32) return cast<1>(field, packet);
  if (field.table->size <= 64) return cast<2>(field, packet);
  return cast<4>(field, packet);
}

}  // namespace vantage
