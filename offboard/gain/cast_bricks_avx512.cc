// Sixteen rays at once through a field of bricks. Compiled for AVX-512 F, BW, DQ and VL.
//
// Rays in uniform bricks cross them, or the cubes of like ones they lie in, in one step each; then rays in the others
// walk voxel by voxel until most have left theirs. Integer times make k steps at once the same as k steps one by one
// (ray_packet.h).

#include <immintrin.h>

#include "offboard/gain/avx512_columns.h"
#include "offboard/gain/cast_block.h"

namespace vantage {
namespace {

/// Sixteen rays in flight, and what they have gathered.
template <int kPairs>
class BrickPacket {
 public:
  BrickPacket(const FieldView& field, const RayPacket<16>& packet)
      : field_(field), pass_(field.table->pass.data()), entropy_(field.table->entropy.data()) {
    alive_ = _mm512_test_epi32_mask(load(packet.hits_region), load(packet.hits_region));
    for (std::size_t a = 0; a < 3; ++a) {
      time_[a] = load(packet.time[a]);
      period_[a] = load(packet.period[a]);
      inverse_[a] = _mm512_div_ps(_mm512_set1_ps(1), _mm512_cvtepi32_ps(period_[a]));
      voxel_[a] = load(packet.voxel[a]);
      forward_[a] = _mm512_cmpgt_epi32_mask(load(packet.direction[a]), _mm512_setzero_si512());
      // Turns a position in a brick or cube, under its mask, into the faces ahead less one.
      flip_[a] = _mm512_maskz_set1_epi32(forward_[a], -1);
    }
  }

  RaySums run() {
    while (alive_ != 0) {
      __m512i word = brick_words();
      const __m512i entry = _mm512_and_si512(word, _mm512_set1_epi32(kEntryMask));
      const __mmask16 uniform =
          _mm512_mask_cmplt_epi32_mask(_mm512_mask_cmplt_epi32_mask(alive_, word, _mm512_setzero_si512()), entry,
                                       _mm512_set1_epi32(field_.table->stop_begin));
      if (uniform != 0) cross(uniform, word);
      const __mmask16 mixed = static_cast<__mmask16>(alive_ & ~uniform);
      if (mixed != 0) walk(mixed, word);
    }
    RaySums sums;
    sums.visits = visits_;
    sums.rear_side_voxels = rear_side_voxels_;
    sums.ends_occupied = ends_occupied_;
    sums.ends_occplane = __builtin_popcount(_mm512_test_epi32_mask(seen_, _mm512_set1_epi32(kOccplaneBit)));
    sums.proximity_steps = _mm512_reduce_add_epi32(proximity_);
    sums.entropy = sum(entropy_sum_);
    sums.occlusion_aware = sum(occlusion_aware_);
    sums.unobserved_voxel = sum(unobserved_);
    sums.rear_side_entropy = sum(rear_side_entropy_);
    return sums;
  }

 private:
  __m512i brick_words() const {
    __m512i at = _mm512_set1_epi32(field_.first_brick_offset);
    for (std::size_t a = 0; a < 3; ++a) {
      at = _mm512_add_epi32(
          at, _mm512_mullo_epi32(_mm512_srai_epi32(voxel_[a], 3), _mm512_set1_epi32(field_.brick_strides[a])));
    }
    return _mm512_mask_i32gather_epi32(_mm512_setzero_si512(), alive_, at, field_.brick_words, 4);
  }

  /// Which axis' face comes next: x before y before z where two come at once.
  static void next_axis(const __m512i time[3], __mmask16 go[3]) {
    const __mmask16 x_after_y = _mm512_cmpgt_epi32_mask(time[0], time[1]);
    const __mmask16 x_after_z = _mm512_cmpgt_epi32_mask(time[0], time[2]);
    const __mmask16 y_after_z = _mm512_cmpgt_epi32_mask(time[1], time[2]);
    go[0] = static_cast<__mmask16>(~(x_after_y | x_after_z));
    go[1] = static_cast<__mmask16>(x_after_y & ~y_after_z);
    go[2] = static_cast<__mmask16>(x_after_z & y_after_z);
  }

  __m512i faces_ahead(std::size_t a, __m512i mask) const {  // less one
    return _mm512_and_si512(_mm512_xor_si512(voxel_[a], flip_[a]), mask);
  }

  void advance(std::size_t a, __mmask16 lanes, __m512i count) {
    voxel_[a] = _mm512_mask_add_epi32(voxel_[a], static_cast<__mmask16>(lanes & forward_[a]), voxel_[a], count);
    voxel_[a] = _mm512_mask_sub_epi32(voxel_[a], static_cast<__mmask16>(lanes & ~forward_[a]), voxel_[a], count);
  }

  void cross(__mmask16 lanes, __m512i word);
  void walk(__mmask16 lanes, __m512i word);

  const FieldView& field_;
  const Column<kPairs> pass_, entropy_;
  __m512i time_[3], period_[3], voxel_[3], flip_[3];
  __m512 inverse_[3];
  __mmask16 forward_[3];
  __mmask16 alive_, before_unknown_ = 0;
  __m512 visibility_ = _mm512_set1_ps(1), run_ = _mm512_setzero_ps();
  __m512 entropy_sum_ = _mm512_setzero_ps(), occlusion_aware_ = _mm512_setzero_ps(), unobserved_ = _mm512_setzero_ps(),
         rear_side_entropy_ = _mm512_setzero_ps();
  __m512i proximity_ = _mm512_setzero_si512(), seen_ = _mm512_setzero_si512();
  std::int64_t visits_ = 0, rear_side_voxels_ = 0, ends_occupied_ = 0;
};

/// Crosses cubes of uniform bricks that do not stop rays.
template <int kPairs>
void BrickPacket<kPairs>::cross(__mmask16 lanes, __m512i word) {
  const __m512i one = _mm512_set1_epi32(1), entry = _mm512_and_si512(word, _mm512_set1_epi32(kEntryMask));
  const __m512i log2_cube =
      _mm512_srli_epi32(_mm512_and_si512(word, _mm512_set1_epi32(FieldView::kCubeMask)), FieldView::kCubeShift);
  const __m512i in_cube = _mm512_sub_epi32(_mm512_sllv_epi32(_mm512_set1_epi32(8), log2_cube), one);
  __m512i exit[3];
  for (std::size_t a = 0; a < 3; ++a) {
    const __m512i ahead = faces_ahead(a, in_cube);
    const __m512i at = _mm512_add_epi32(time_[a], _mm512_mullo_epi32(ahead, period_[a]));
    // A product beyond 2^30 lies past the region; the sum of two numbers below 2^30 is right.
    const __mmask16 near = _mm512_cmplt_ps_mask(
        _mm512_mul_ps(_mm512_cvtepi32_ps(ahead), _mm512_cvtepi32_ps(period_[a])), _mm512_set1_ps(1073741824.0F));
    exit[a] = _mm512_mask_mov_epi32(_mm512_set1_epi32(0x7fffffff), near, at);
  }
  __mmask16 out[3];
  next_axis(exit, out);
  const __m512i end = _mm512_min_epi32(_mm512_min_epi32(exit[0], exit[1]), exit[2]);
  // Crossings of axis a up to the exit; at the exit's own time those of axes up to the exit's.
  const __mmask16 up_to[3] = {0xffff, static_cast<__mmask16>(out[1] | out[2]), out[2]};
  __m512i visits = _mm512_setzero_si512();
  for (std::size_t a = 0; a < 3; ++a) {
    const __m512i last = _mm512_mask_sub_epi32(end, static_cast<__mmask16>(~up_to[a]), end, one);
    const __m512i left = _mm512_sub_epi32(last, time_[a]);
    const __mmask16 any = static_cast<__mmask16>(_mm512_cmpge_epi32_mask(left, _mm512_setzero_si512()) & lanes);
    // The quotient from single precision is right but for one; integers settle it.
    __m512i quotient = _mm512_cvttps_epi32(_mm512_mul_ps(_mm512_cvtepi32_ps(left), inverse_[a]));
    const __m512i rest = _mm512_sub_epi32(left, _mm512_mullo_epi32(quotient, period_[a]));
    quotient = _mm512_mask_sub_epi32(quotient, _mm512_cmplt_epi32_mask(rest, _mm512_setzero_si512()), quotient, one);
    quotient = _mm512_mask_add_epi32(quotient, _mm512_cmpge_epi32_mask(rest, period_[a]), quotient, one);
    const __m512i count = _mm512_maskz_add_epi32(any, quotient, one);
    time_[a] = _mm512_add_epi32(time_[a], _mm512_mullo_epi32(count, period_[a]));
    advance(a, lanes, count);
    visits = _mm512_add_epi32(visits, count);
  }
  visits_ += _mm512_reduce_add_epi32(visits);
  // q^k and 1 + q + ... + q^(k-1) for k = visits < 256, by doubling.
  const __m512 q = pass_.at(entry), entropy = entropy_.at(entry), unit = _mm512_set1_ps(1);
  __m512 power = unit, series = _mm512_setzero_ps(), base_power = q, base_series = unit;
  const int most = _mm512_mask_reduce_max_epi32(lanes, visits);
  for (int bit = 1; bit <= most; bit <<= 1) {
    const __mmask16 set = _mm512_test_epi32_mask(visits, _mm512_set1_epi32(bit));
    series = _mm512_mask_add_ps(series, set, series, _mm512_mul_ps(power, base_series));
    power = _mm512_mask_mul_ps(power, set, power, base_power);
    base_series = _mm512_mul_ps(base_series, _mm512_add_ps(unit, base_power));
    base_power = _mm512_mul_ps(base_power, base_power);
  }
  const __m512 visible = _mm512_mul_ps(_mm512_mul_ps(visibility_, entropy), series);
  const __mmask16 unknown = _mm512_mask_cmplt_epi32_mask(lanes, entry, _mm512_set1_epi32(field_.table->unknown_end));
  entropy_sum_ =
      _mm512_mask_add_ps(entropy_sum_, lanes, entropy_sum_, _mm512_mul_ps(entropy, _mm512_cvtepi32_ps(visits)));
  occlusion_aware_ = _mm512_mask_add_ps(occlusion_aware_, lanes, occlusion_aware_, visible);
  unobserved_ = _mm512_mask_add_ps(unobserved_, unknown, unobserved_, visible);
  visibility_ = _mm512_mask_mul_ps(visibility_, lanes, visibility_, power);
  run_ = _mm512_mask_mov_ps(run_, lanes, _mm512_maskz_add_ps(unknown, run_, visible));
  before_unknown_ = static_cast<__mmask16>((before_unknown_ & ~lanes) | unknown);
}

/// Walks the rays of `lanes`, whose bricks are not uniform (or stop rays), until most have left their brick or ended.
template <int kPairs>
void BrickPacket<kPairs>::walk(__mmask16 lanes, __m512i word) {
  const VisitTable& table = *field_.table;
  const __m512i unknown_end = _mm512_set1_epi32(table.unknown_end), stop_begin = _mm512_set1_epi32(table.stop_begin);
  const __m512i sentinel = _mm512_set1_epi32(table.sentinel()), entry_mask = _mm512_set1_epi32(kEntryMask);
  const __m512i zero = _mm512_setzero_si512(), parked = _mm512_set1_epi32(table.parked());
  const __mmask16 has_proximity = _mm512_mask_test_epi32_mask(lanes, word, _mm512_set1_epi32(FieldView::kHasProximity));

  // A uniform brick that stops rays ends them here and now.
  const __mmask16 wall = _mm512_mask_cmplt_epi32_mask(lanes, word, zero);
  // Faces ahead, less one, as a field of four bits an axis, whose top bit goes out when the last face is crossed.
  // Shifts by 0, 3 and 9 bring the fields' bits to where offset_in_brick() has them, inverted for axes walked forward.
  constexpr unsigned kField[3] = {9, 5, 13};
  const __m512i guards = _mm512_set1_epi32(8 << kField[0] | 8 << kField[1] | 8 << kField[2]);
  __m512i state = guards, base = _mm512_slli_epi32(word, 9);
  __m512i ahead_before[3];
  for (std::size_t a = 0; a < 3; ++a) {
    ahead_before[a] = faces_ahead(a, _mm512_set1_epi32(7));
    state = _mm512_add_epi32(state, _mm512_slli_epi32(ahead_before[a], kField[a]));
    const unsigned all = offset_in_brick(a == 0 ? 7 : 0, a == 1 ? 7 : 0, a == 2 ? 7 : 0);
    base = _mm512_xor_si512(base, _mm512_and_si512(flip_[a], _mm512_set1_epi32(static_cast<int>(all))));
  }
  __mmask16 walking = lanes;
  const int enough = __builtin_popcount(lanes) / 2;
  do {
    constexpr int kXorMasked = 0x78;  // a ^ (b & c)
    __m512i at = _mm512_ternarylogic_epi32(base, state, _mm512_set1_epi32(0x80), kXorMasked);
    at = _mm512_ternarylogic_epi32(at, _mm512_srli_epi32(state, 3), _mm512_set1_epi32(0x10c), kXorMasked);
    at = _mm512_ternarylogic_epi32(at, _mm512_srli_epi32(state, 9), _mm512_set1_epi32(0x73), kXorMasked);
    __m512i code =
        _mm512_mask_i32gather_epi32(parked, static_cast<__mmask16>(walking & ~wall), at, field_.brick_codes, 1);
    code = _mm512_mask_mov_epi32(code, wall, word);
    code = _mm512_mask_mov_epi32(parked, walking, code);
    const __m512i entry = _mm512_and_si512(code, entry_mask);
    const __m512 pass = pass_.at(entry), voxel_entropy = entropy_.at(entry);
    const __mmask16 unknown = _mm512_cmplt_epi32_mask(entry, unknown_end);
    const __mmask16 stop = _mm512_cmpge_epi32_mask(entry, stop_begin);
    const __m512 visible = _mm512_mul_ps(visibility_, voxel_entropy);
    entropy_sum_ = _mm512_add_ps(entropy_sum_, voxel_entropy);
    occlusion_aware_ = _mm512_add_ps(occlusion_aware_, visible);
    unobserved_ = _mm512_mask_add_ps(unobserved_, unknown, unobserved_, visible);
    visibility_ = _mm512_mul_ps(visibility_, pass);
    visits_ += __builtin_popcount(walking);
    if (stop != 0) {
      const __mmask16 left = _mm512_mask_cmpeq_epi32_mask(stop, entry, sentinel);
      const __mmask16 occupied = static_cast<__mmask16>(stop & ~left);
      const __mmask16 occplane = _mm512_test_epi32_mask(seen_, _mm512_set1_epi32(kOccplaneBit));
      visits_ -= __builtin_popcount(left);
      rear_side_voxels_ += __builtin_popcount(occupied & before_unknown_);
      ends_occupied_ += __builtin_popcount(occupied & ~static_cast<unsigned>(occplane));
      rear_side_entropy_ = _mm512_mask_add_ps(rear_side_entropy_, occupied, rear_side_entropy_, run_);
      alive_ = static_cast<__mmask16>(alive_ & ~stop);
      // Here alone, not below: else the end of this loop, which is hard to foresee, would wait for the codes to arrive.
      walking = static_cast<__mmask16>(walking & ~stop);
    }
    run_ = _mm512_mask_mov_ps(run_, walking, _mm512_maskz_add_ps(unknown, run_, visible));
    before_unknown_ = static_cast<__mmask16>((before_unknown_ & ~walking) | unknown);
    seen_ = _mm512_or_si512(seen_, code);
    const __mmask16 near = static_cast<__mmask16>(unknown & has_proximity & walking);
    if (near != 0) {
      const __m512i proximity = _mm512_mask_i32gather_epi32(zero, near, at, field_.brick_proximity, 1);
      proximity_ = _mm512_add_epi32(proximity_, _mm512_and_si512(proximity, _mm512_set1_epi32(0xff)));
    }
    __mmask16 go[3];
    next_axis(time_, go);
    for (std::size_t a = 0; a < 3; ++a) {
      const __mmask16 goes = static_cast<__mmask16>(go[a] & walking);
      time_[a] = _mm512_mask_add_epi32(time_[a], goes, time_[a], period_[a]);
      state = _mm512_mask_sub_epi32(state, goes, state, _mm512_set1_epi32(1 << kField[a]));
    }
    walking = _mm512_mask_cmpeq_epi32_mask(walking, _mm512_and_si512(state, guards), guards);
  } while (__builtin_popcount(walking) > enough);
  for (std::size_t a = 0; a < 3; ++a) {
    // Faces crossed: the field's loss, modulo 16 (it may have borrowed nothing from above: its guard stood).
    const __m512i field = _mm512_and_si512(_mm512_srli_epi32(state, kField[a]), _mm512_set1_epi32(15));
    advance(a, lanes, _mm512_sub_epi32(_mm512_add_epi32(ahead_before[a], _mm512_set1_epi32(8)), field));
  }
}

}  // namespace

RaySums cast_bricks_avx512(const FieldView& field, const GridWalk& walk, const RayColumns& rays, std::size_t block) {
  RayPacket<kRaysPerBlock> packet;
  prepare_packet(walk, rays, block * kRaysPerBlock, &packet);
  if (field.table->size <= 32) return BrickPacket<1>(field, packet).run();
  if (field.table->size <= 64) return BrickPacket<2>(field, packet).run();
  return BrickPacket<4>(field, packet).run();
}

}  // namespace vantage
