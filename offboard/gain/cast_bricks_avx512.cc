// Many rays at once through a field of bricks. Compiled for AVX-512 F, BW, DQ and VL.
//
// A step takes every ray, for itself, out of the cube of like cells that it is in, or out of its voxel where the cell
// is not uniform: a voxel is a cube with an edge of one. Integer times make k steps at once the same as k steps one by
// one (ray_packet.h). A ray that has ended makes room for the next, so that lanes are seldom idle, however much the
// rays' ways differ. A ray's numbers depend on nothing but the ray, and a block's sums are its rays' in order.
//
// What costs time here is waiting: for codes from distant caches, and for branches foretold wrongly because what they
// ask depends on those codes. So several groups of sixteen rays take turns, and a step has no branch at all: what
// seldom happens (proximities, rays that end) is seen to at the group's next turn, when its loads have long arrived.

#include <immintrin.h>

#include "offboard/gain/avx512_columns.h"
#include "offboard/gain/cast_block.h"

namespace vantage {
namespace {

constexpr std::size_t kLanes = 16;
static_assert(kLanes == kRaysPerBlock);
constexpr std::size_t kGroups = 8;      // taking turns
constexpr std::size_t kMaxBlocks = 64;  // cast together
constexpr std::size_t kMaxRays = kMaxBlocks * kRaysPerBlock;
constexpr int kOrMasked = 0xf8;  // of vpternlogd: a | (b & c)

/// What each ray of a batch met.
struct alignas(64) RayResults {
  std::array<float, kMaxRays> entropy, occlusion_aware, unobserved, rear_side_entropy;
  std::array<std::int32_t, kMaxRays> visits, proximity, ends;

  static constexpr int kOccupied = 1, kRearSide = 2, kOccplane = 4;  // bits of `ends`

  RaySums sums_of(std::size_t block) const {
    const std::size_t first = block * kRaysPerBlock;
    const auto add_up = [first](const std::array<float, kMaxRays>& of_ray) {
      return sum(_mm512_load_ps(&of_ray[first]));
    };
    const auto count = [first](const std::array<std::int32_t, kMaxRays>& of_ray) {
      return _mm512_reduce_add_epi32(_mm512_load_si512(&of_ray[first]));
    };
    const __m512i ends_of_block = _mm512_load_si512(&ends[first]);
    const auto with = [ends_of_block](int bit) {
      return static_cast<unsigned>(_mm512_test_epi32_mask(ends_of_block, _mm512_set1_epi32(bit)));
    };
    RaySums total;
    total.visits = count(visits);
    total.proximity_steps = count(proximity);
    total.ends_occplane = __builtin_popcount(with(kOccplane));
    total.ends_occupied = __builtin_popcount(with(kOccupied) & ~with(kOccplane));
    total.rear_side_voxels = __builtin_popcount(with(kRearSide));
    total.entropy = add_up(entropy);
    total.occlusion_aware = add_up(occlusion_aware);
    total.unobserved_voxel = add_up(unobserved);
    total.rear_side_entropy = add_up(rear_side_entropy);
    return total;
  }
};

/// The rays of a batch in their order.
class RayQueue {
 public:
  RayQueue(const GridWalk& walk, const RayColumns& rays, const std::size_t* blocks, std::size_t count)
      : walk_(walk), rays_(rays), blocks_(blocks), end_(count * kLanes) {}

  bool empty() const { return next_ == end_; }
  /// The packet of the next ray; the queue must not be empty.
  const RayPacket<kLanes>& packet() {
    if (next_in_packet() == 0) prepare_packet(walk_, rays_, blocks_[next_ / kLanes] * kRaysPerBlock, &packet_);
    return packet_;
  }
  std::size_t next_in_packet() const { return next_ % kLanes; }
  std::size_t next_in_batch() const { return next_; }
  void pop(int rays) { next_ += static_cast<std::size_t>(rays); }

 private:
  const GridWalk& walk_;
  const RayColumns& rays_;
  const std::size_t* blocks_;
  std::size_t end_, next_ = 0;
  RayPacket<kLanes> packet_;
};

/// Columns of the visit table in registers.
template <int kPairs>
struct TableColumns {
  explicit TableColumns(const VisitTable& table)
      : entropy(table.entropy.data()),
        log2_pass(table.log2_pass.data()),
        series_scale(table.series_scale.data()),
        unknown_end(_mm512_set1_epi32(table.unknown_end)),
        stop_begin(_mm512_set1_epi32(table.stop_begin)),
        sentinel(_mm512_set1_epi32(table.sentinel())),
        parked(_mm512_set1_epi32(static_cast<int>(FieldView::kUniformCell) | table.parked())) {}

  const Column<kPairs> entropy, log2_pass, series_scale;
  const __m512i unknown_end, stop_begin, sentinel;
  const __m512i parked;  // the word of a ray that is no more
};

/// q^k and 1 + q + ... + q^(k-1), from log2 q and 1 / (q - 1), to a few units in the last place.
struct PowerAndSeries {
  __m512 power, series;

  PowerAndSeries(__m512 k, __m512 log2_q, __m512 series_scale) {
    const __m512 exponent = _mm512_mul_ps(k, log2_q), whole = _mm512_roundscale_ps(exponent, _MM_FROUND_TO_NEAREST_INT);
    const __m512 f = _mm512_sub_ps(exponent, whole);  // within [-1/2, 1/2]
    // 2^f - 1 by Taylor: ln(2)^n / n!; the term left out is below 1.2e-7.
    __m512 g = _mm512_set1_ps(1.54035304e-4F);
    for (const float c : {1.33335581e-3F, 9.61812911e-3F, 5.55041087e-2F, 2.40226507e-1F, 6.93147181e-1F}) {
      g = _mm512_fmadd_ps(g, f, _mm512_set1_ps(c));
    }
    g = _mm512_mul_ps(g, f);
    // q^k - 1 = 2^whole g + (2^whole - 1): exact in the second term, so that small sums keep their digits.
    const __m512 one = _mm512_set1_ps(1), scale = _mm512_scalef_ps(one, whole);
    power = _mm512_fmadd_ps(scale, g, scale);
    series = _mm512_mul_ps(_mm512_fmadd_ps(scale, g, _mm512_sub_ps(scale, one)), series_scale);
  }
};

/// Asks for what lies at `base` + kSize `at`.
template <int kSize>
void prefetch(const void* base, __m512i at) {
  alignas(64) std::array<std::int32_t, kLanes> offsets;
  _mm512_store_si512(offsets.data(), at);
  for (const std::int32_t offset : offsets)
    __builtin_prefetch(static_cast<const char*>(base) + std::ptrdiff_t{kSize} * offset);
}

/// Sixteen rays in flight, and what they have gathered. A turn is look_up(), then cross().
template <int kPairs>
class RayGroup {
 public:
  /// False when all rays have ended and none is left.
  bool busy() const { return (alive_ | ended_) != 0; }
  /// Takes the first rays.
  void start(const FieldView& field, RayQueue* queue) {
    take_from(queue);
    aim(field);
  }
  /// Sees to what the last turn left, and loads the words of the cells that the rays are in.
  void look_up(const FieldView& field, const TableColumns<kPairs>& table, RayQueue* queue, RayResults* results);
  /// Takes the rays out of their cubes or voxels.
  void cross(const FieldView& field, const TableColumns<kPairs>& table);

 private:
  void take_from(RayQueue* queue);
  void write_down(RayResults* results);
  void aim(const FieldView& field);
  __m512i leave(__m512i in_cube);

  static constexpr bool kOctets = kPairs <= 2;  // VisitTable::octet_bit()
  static constexpr int kEnough = 4;             // rays ended, to take new ones

  // The walk, axis by axis. Positions count down along the ray: a voxel's number for rays that go back, its complement
  // (forward_: all bits set) for the others.
  __m512i time_[3], period_[3], position_[3], forward_[3];
  __m512 inverse_[3];  // a little less than 1 / period
  __m512i limit_[3];   // so many periods take longer than the way through the region, or than any cube

  // Where the rays look: their cell's word, their voxel in the cell, its code.
  __m512i word_at_, in_cell_, word_, code_at_;

  __mmask16 alive_ = 0, ended_ = 0;  // neither: empty
  __mmask16 near_ = 0;               // the last code has a proximity that counts
  __mmask16 before_unknown_ = 0, occupied_ = 0, rear_side_ = 0;
  __m512 visibility_, run_, entropy_, occlusion_aware_, unobserved_, rear_side_entropy_;
  __m512i visits_, proximity_, seen_;
  __m512i ray_;  // its place in the batch
};

template <int kPairs>
void RayGroup<kPairs>::take_from(RayQueue* queue) {
  const __m512i zero = _mm512_setzero_si512();
  while (!queue->empty()) {
    unsigned empty = static_cast<__mmask16>(~(alive_ | ended_));
    if (empty == 0) return;
    const RayPacket<kLanes>& packet = queue->packet();
    const std::size_t from = queue->next_in_packet();
    while (__builtin_popcount(empty) > static_cast<int>(kLanes - from)) empty &= empty - 1;
    const auto lanes = static_cast<__mmask16>(empty);
    const auto load = [lanes, from](__m512i* to, const std::array<std::int32_t, kLanes>& column) {
      *to = _mm512_mask_expandloadu_epi32(*to, lanes, column.data() + from);
    };
    for (std::size_t a = 0; a < 3; ++a) {
      load(&time_[a], packet.time[a]);
      load(&period_[a], packet.period[a]);
      load(&position_[a], packet.voxel[a]);
      load(&forward_[a], packet.direction[a]);
      forward_[a] =
          _mm512_mask_mov_epi32(forward_[a], lanes, _mm512_movm_epi32(_mm512_cmpgt_epi32_mask(forward_[a], zero)));
      position_[a] = _mm512_mask_xor_epi32(position_[a], lanes, position_[a], forward_[a]);
      const __m512 period = _mm512_cvtepi32_ps(period_[a]);
      inverse_[a] = _mm512_mask_div_ps(inverse_[a], lanes, _mm512_set1_ps(1 - 0x1p-21F), period);
      const __m512 fit = _mm512_div_ps(_mm512_set1_ps(0x1p31F - 0x1p8F), period);
      limit_[a] = _mm512_mask_cvttps_epi32(limit_[a], lanes,
                                           _mm512_min_ps(fit, _mm512_set1_ps(static_cast<float>(FieldView::kMaxEdge))));
    }
    __m512i hits_region = zero;
    load(&hits_region, packet.hits_region);
    alive_ = static_cast<__mmask16>(alive_ | _mm512_test_epi32_mask(hits_region, hits_region));
    visibility_ = _mm512_mask_mov_ps(visibility_, lanes, _mm512_set1_ps(1));
    for (__m512* total : {&run_, &entropy_, &occlusion_aware_, &unobserved_, &rear_side_entropy_}) {
      *total = _mm512_mask_mov_ps(*total, lanes, _mm512_setzero_ps());
    }
    for (__m512i* total : {&visits_, &proximity_, &seen_}) *total = _mm512_mask_mov_epi32(*total, lanes, zero);
    for (__mmask16* flags : {&before_unknown_, &occupied_, &rear_side_}) {
      *flags = static_cast<__mmask16>(*flags & ~lanes);
    }
    const __m512i in_order = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    const __m512i first = _mm512_set1_epi32(static_cast<int>(queue->next_in_batch()));
    ray_ = _mm512_mask_expand_epi32(ray_, lanes, _mm512_add_epi32(first, in_order));
    queue->pop(__builtin_popcount(empty));
  }
}

template <int kPairs>
void RayGroup<kPairs>::write_down(RayResults* results) {
  const auto scatter = [this](std::array<std::int32_t, kMaxRays>* to, __m512i from) {
    _mm512_mask_i32scatter_epi32(to->data(), ended_, ray_, from, sizeof(std::int32_t));
  };
  const auto scatter_floats = [this](std::array<float, kMaxRays>* to, __m512 from) {
    _mm512_mask_i32scatter_ps(to->data(), ended_, ray_, from, sizeof(float));
  };
  const __mmask16 occplane = _mm512_test_epi32_mask(seen_, _mm512_set1_epi32(kOccplaneBit));
  scatter_floats(&results->entropy, entropy_);
  scatter_floats(&results->occlusion_aware, occlusion_aware_);
  scatter_floats(&results->unobserved, unobserved_);
  scatter_floats(&results->rear_side_entropy, rear_side_entropy_);
  scatter(&results->visits, visits_);
  scatter(&results->proximity, proximity_);
  scatter(&results->ends, _mm512_or_si512(_mm512_or_si512(_mm512_maskz_set1_epi32(occupied_, RayResults::kOccupied),
                                                          _mm512_maskz_set1_epi32(rear_side_, RayResults::kRearSide)),
                                          _mm512_maskz_set1_epi32(occplane, RayResults::kOccplane)));
  ended_ = 0;
}

/// Finds where the rays' cells have their words.
template <int kPairs>
void RayGroup<kPairs>::aim(const FieldView& field) {
  __m512i voxel[3];
  for (std::size_t a = 0; a < 3; ++a) voxel[a] = _mm512_xor_si512(position_[a], forward_[a]);
  const auto bricks = [](__m512i along, std::int32_t stride) {
    return _mm512_mullo_epi32(_mm512_srai_epi32(along, 3), _mm512_set1_epi32(8 * stride));
  };
  const auto bits = [](__m512i base, __m512i from, int mask) {
    return _mm512_ternarylogic_epi32(base, from, _mm512_set1_epi32(mask), kOrMasked);
  };
  __m512i brick = _mm512_add_epi32(bricks(voxel[1], field.brick_strides[0]), bricks(voxel[2], field.brick_strides[1]));
  brick = _mm512_add_epi32(brick, _mm512_andnot_si512(_mm512_set1_epi32(7), voxel[0]));
  brick = _mm512_add_epi32(brick, _mm512_set1_epi32(8 * field.first_brick));
  __m512i cell = bits(brick, _mm512_srli_epi32(voxel[0], 2), 1);  // cell_in_brick()
  cell = bits(cell, _mm512_srli_epi32(voxel[1], 1), 2);
  word_at_ = _mm512_maskz_mov_epi32(alive_, bits(cell, voxel[2], 4));
  in_cell_ = _mm512_and_si512(voxel[0], _mm512_set1_epi32(3));  // offset_in_cell()
  in_cell_ = bits(in_cell_, _mm512_slli_epi32(voxel[1], 2), 3 << 2);
  in_cell_ = bits(in_cell_, _mm512_slli_epi32(voxel[2], 4), 3 << 4);
  prefetch<sizeof(std::uint32_t)>(field.cell_words, word_at_);
}

template <int kPairs>
void RayGroup<kPairs>::look_up(const FieldView& field, const TableColumns<kPairs>& table, RayQueue* queue,
                               RayResults* results) {
  if (near_ != 0) {
    const __m512i proximity =
        _mm512_mask_i32gather_epi32(_mm512_setzero_si512(), near_, code_at_, field.cell_proximity, 1);
    proximity_ = _mm512_add_epi32(proximity_, _mm512_and_si512(proximity, _mm512_set1_epi32(0xff)));
  }
  if (__builtin_popcount(ended_) >= kEnough || (alive_ == 0 && ended_ != 0)) {
    write_down(results);
    take_from(queue);
    aim(field);
  }
  word_ = _mm512_mask_i32gather_epi32(table.parked, alive_, word_at_, field.cell_words, 4);
  const __mmask16 mixed = static_cast<__mmask16>(~_mm512_movepi32_mask(word_));
  code_at_ = _mm512_maskz_or_epi32(mixed, in_cell_, _mm512_slli_epi32(word_, 6));
  prefetch<1>(field.cell_codes, code_at_);
}

/// Leaves the cube of which `in_cube` is the mask of positions, 0 for a voxel; how many of its voxels were met.
template <int kPairs>
__m512i RayGroup<kPairs>::leave(__m512i in_cube) {
  const __m512i one = _mm512_set1_epi32(1);
  __m512i exit[3];  // when the ray meets the cube's face ahead; unsigned: sums of two numbers below 2^31
  for (std::size_t a = 0; a < 3; ++a) {
    const __m512i faces = _mm512_min_epi32(_mm512_and_si512(position_[a], in_cube), limit_[a]);
    exit[a] = _mm512_add_epi32(time_[a], _mm512_mullo_epi32(faces, period_[a]));
  }
  const __m512i end = _mm512_min_epu32(_mm512_min_epu32(exit[0], exit[1]), exit[2]);
  // x goes before y before z where two come at once: faces of an axis after the exit's must come before the end.
  const __mmask16 out_x = _mm512_cmpeq_epi32_mask(exit[0], end);
  const __mmask16 not_after_y = static_cast<__mmask16>(out_x | _mm512_cmpeq_epi32_mask(exit[1], end));
  const __mmask16 before[3] = {0, out_x, not_after_y};
  __m512i visits = _mm512_setzero_si512();
  for (std::size_t a = 0; a < 3; ++a) {
    const __m512i last = _mm512_mask_sub_epi32(end, before[a], end, one);
    const __m512i left = _mm512_sub_epi32(last, time_[a]);
    const __mmask16 any = static_cast<__mmask16>(~_mm512_movepi32_mask(left));
    // The quotient from single precision is right or one too small; integers settle it.
    __m512i crossed = _mm512_cvttps_epi32(_mm512_mul_ps(_mm512_cvtepi32_ps(left), inverse_[a]));
    const __m512i rest = _mm512_sub_epi32(left, _mm512_mullo_epi32(crossed, period_[a]));
    crossed = _mm512_mask_add_epi32(crossed, _mm512_cmpge_epi32_mask(rest, period_[a]), crossed, one);
    crossed = _mm512_maskz_add_epi32(any, crossed, one);
    time_[a] = _mm512_add_epi32(time_[a], _mm512_mullo_epi32(crossed, period_[a]));
    position_[a] = _mm512_sub_epi32(position_[a], crossed);
    visits = _mm512_add_epi32(visits, crossed);
  }
  return visits;
}

template <int kPairs>
void RayGroup<kPairs>::cross(const FieldView& field, const TableColumns<kPairs>& table) {
  const __mmask16 uniform = _mm512_movepi32_mask(word_), mixed = static_cast<__mmask16>(~uniform);
  const __m512i code = _mm512_mask_i32gather_epi32(word_, mixed, code_at_, field.cell_codes, 1);
  const __m512i entry = _mm512_and_si512(code, _mm512_set1_epi32(kOctets ? kEntryMask / 2 : kEntryMask));
  const __mmask16 unknown = _mm512_cmplt_epi32_mask(entry, table.unknown_end);
  const __mmask16 stop = _mm512_cmpge_epi32_mask(entry, table.stop_begin);
  const __mmask16 left = _mm512_cmpeq_epi32_mask(entry, table.sentinel);
  const __mmask16 occupied = static_cast<__mmask16>(stop & ~left);

  __m512i in_cube = _mm512_setzero_si512();
  if constexpr (kOctets) in_cube = _mm512_and_si512(_mm512_srli_epi32(code, 6), _mm512_set1_epi32(1));
  in_cube = _mm512_mask_and_epi32(in_cube, uniform, _mm512_srli_epi32(word_, FieldView::kSpanShift),
                                  _mm512_set1_epi32(FieldView::kMaxEdge - 1));
  const __m512i visits = leave(in_cube);
  const __m512 k = _mm512_cvtepi32_ps(visits), entropy = table.entropy.at(entry);
  const PowerAndSeries pass(k, table.log2_pass.at(entry), table.series_scale.at(entry));
  const __m512 visible = _mm512_mul_ps(_mm512_mul_ps(visibility_, entropy), pass.series);

  visits_ = _mm512_mask_add_epi32(visits_, static_cast<__mmask16>(alive_ & ~left), visits_, visits);
  entropy_ = _mm512_add_ps(entropy_, _mm512_mul_ps(entropy, k));
  occlusion_aware_ = _mm512_add_ps(occlusion_aware_, visible);
  unobserved_ = _mm512_mask_add_ps(unobserved_, unknown, unobserved_, visible);
  visibility_ = _mm512_mul_ps(visibility_, pass.power);
  rear_side_entropy_ = _mm512_mask_mov_ps(rear_side_entropy_, occupied, run_);
  rear_side_ = static_cast<__mmask16>(rear_side_ | (occupied & before_unknown_));
  occupied_ = static_cast<__mmask16>(occupied_ | occupied);
  run_ = _mm512_maskz_add_ps(unknown, run_, visible);
  before_unknown_ = unknown;
  seen_ = _mm512_mask_or_epi32(seen_, mixed, seen_, code);
  near_ = _mm512_mask_test_epi32_mask(static_cast<__mmask16>(unknown & mixed), word_,
                                      _mm512_set1_epi32(FieldView::kHasProximity));
  alive_ = static_cast<__mmask16>(alive_ & ~stop);
  ended_ = static_cast<__mmask16>(ended_ | stop);
  aim(field);
}

template <int kPairs>
void cast_batch(const FieldView& field, const GridWalk& walk, const RayColumns& rays, const std::size_t* blocks,
                std::size_t count, RaySums* sums) {
  RayResults results{};  // rays that miss the region leave zeros
  RayQueue queue(walk, rays, blocks, count);
  const TableColumns<kPairs> table(*field.table);
  std::array<RayGroup<kPairs>, kGroups> groups{};
  for (RayGroup<kPairs>& group : groups) group.start(field, &queue);
  for (bool busy = true; busy;) {
    busy = false;
    for (RayGroup<kPairs>& group : groups) group.look_up(field, table, &queue, &results);
    for (RayGroup<kPairs>& group : groups) {
      group.cross(field, table);
      busy |= group.busy();
    }
  }
  for (std::size_t block = 0; block < count; ++block) sums[block] = results.sums_of(block);
}

}  // namespace

void cast_bricks_avx512(const FieldView& field, const GridWalk& walk, const RayColumns& rays, const std::size_t* blocks,
                        std::size_t count, RaySums* sums) {
  const auto cast = field.table->size <= 32 ? cast_batch<1> : field.table->size <= 64 ? cast_batch<2> : cast_batch<4>;
  for (std::size_t first = 0; first < count; first += kMaxBlocks) {
    cast(field, walk, rays, blocks + first, count - first < kMaxBlocks ? count - first : kMaxBlocks, sums + first);
  }
}

}  // namespace vantage
