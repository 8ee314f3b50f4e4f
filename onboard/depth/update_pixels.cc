// Compiled once for each instruction set (foreach_target.h includes this file again and again).
#include "onboard/depth/update_pixels.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "onboard/depth/update_pixels.cc"
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_AVX3_DL)
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace vantage {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using Floats = hn::ScalableTag<float>;
using Ints = hn::RebindToSigned<Floats>;
using VF = hn::Vec<Floats>;
using VI = hn::Vec<Ints>;

constexpr int kMaxLanes = 16;
// Room for a last vector that reaches past the end; whole vectors a row, so that rows are aligned.
constexpr int kStripColumns = (kMaxSteps + kPatchColumns - 1 + 2 * kMaxLanes) / kMaxLanes * kMaxLanes;
constexpr int kStripRows = kPatchRows + 2 * kMaxAcross;

/// Grey at (x, y), bilinear; coordinates are pulled inside the image.
HWY_INLINE VF sample(const ImagePyramid::Level& image, VF x, VF y) {
  const Floats df;
  const Ints di;
  const VF zero = hn::Zero(df);
  x = hn::Min(hn::Max(x, zero), hn::Set(df, static_cast<float>(image.width) - 1.001F));
  y = hn::Min(hn::Max(y, zero), hn::Set(df, static_cast<float>(image.height) - 1.001F));
  const VI column = hn::ConvertTo(di, x), row = hn::ConvertTo(di, y);
  const VF fx = hn::Sub(x, hn::ConvertTo(df, column)), fy = hn::Sub(y, hn::ConvertTo(df, row));
  const VI stride = hn::Set(di, image.stride);
  const VI offset = hn::Add(hn::Mul(row, stride), column);
  // Four bytes at once: the two neighbours are the lowest two.
  const auto* base = reinterpret_cast<const std::int32_t*>(image.pixels);
  const VI upper = hn::GatherOffset(di, base, offset);
  const VI lower = hn::GatherOffset(di, base, hn::Add(offset, stride));
  const VI byte = hn::Set(di, 0xFF);
  const VF p00 = hn::ConvertTo(df, hn::And(upper, byte));
  const VF p10 = hn::ConvertTo(df, hn::And(hn::ShiftRight<8>(upper), byte));
  const VF p01 = hn::ConvertTo(df, hn::And(lower, byte));
  const VF p11 = hn::ConvertTo(df, hn::And(hn::ShiftRight<8>(lower), byte));
  const VF top = hn::MulAdd(fx, hn::Sub(p10, p00), p00), bottom = hn::MulAdd(fx, hn::Sub(p11, p01), p01);
  return hn::MulAdd(fy, hn::Sub(bottom, top), top);
}

// A patch's rows are padded to eight samples, so that one is a vector of AVX2 and two of NEON or SSE.
constexpr int kRow = 8;
static_assert(kPatchColumns < kRow && kMaxLanes % kRow == 0);
using Rows = hn::CappedTag<float, kRow>;
using VR = hn::Vec<Rows>;

/// The key frame's patch, made to look as it would in the frame.
struct Template {
  float mean;

  /// Zero-mean, unit norm, row by row; the padding is 0. What stands to the left of the first sample may be read.
  float* grey() { return samples_ + kMaxLanes; }
  const float* grey() const { return samples_ + kMaxLanes; }

 private:
  HWY_ALIGN float samples_[kMaxLanes + kPatchRows * kRow + kMaxLanes] = {};
};

/// Offsets of the patch's samples from its centre: along in steps of kStep, across in pixels. What weighs in sums.
struct PatchTables {
  HWY_ALIGN float along[kPatchRows * kRow + kMaxLanes] = {};
  HWY_ALIGN float across[kPatchRows * kRow + kMaxLanes] = {};
  HWY_ALIGN float all[kRow] = {};    ///< 1 for a column of the patch
  HWY_ALIGN float inner[kRow] = {};  ///< 1 for a column that has neighbours
  constexpr PatchTables() {
    for (int i = 0; i < kPatchRows * kRow; ++i) {
      along[i] = kStep * static_cast<float>(i % kRow - kPatchColumns / 2);
      across[i] = static_cast<float>(i / kRow - kPatchRows / 2);
    }
    for (int i = 0; i < kPatchColumns; ++i) {
      all[i] = 1;
      inner[i] = i > 0 && i + 1 < kPatchColumns ? 1 : 0;
    }
  }
};
constexpr PatchTables kTables;

HWY_INLINE float total(VR lanes) {
  const Rows d;
  return hn::GetLane(hn::SumOfLanes(d, lanes));
}

/// False when the patch has less gradient along the line than its match needs.
HWY_INLINE bool take_template(const UpdateJob& job, const Search& search, float x, float y, Template* patch) {
  const Floats df;
  const EpipolarLine& line = search.line;
  const float inverse_scale = 1 / search.scale;
  const float cx = (x + 0.5F) * inverse_scale - 0.5F, cy = (y + 0.5F) * inverse_scale - 0.5F;
  // Key pixels for one pixel along and one across the line in the frame.
  const float* m = line.to_key;
  const VF ax = hn::Set(df, m[0] * line.ex + m[1] * line.ey), ay = hn::Set(df, m[2] * line.ex + m[3] * line.ey);
  const VF bx = hn::Set(df, -m[0] * line.ey + m[1] * line.ex), by = hn::Set(df, -m[2] * line.ey + m[3] * line.ex);
  for (int i = 0; i < kPatchRows * kRow; i += static_cast<int>(hn::Lanes(df))) {
    const VF along = hn::Load(df, kTables.along + i), across = hn::Load(df, kTables.across + i);
    const VF px = hn::MulAdd(ax, along, hn::MulAdd(bx, across, hn::Set(df, cx)));
    const VF py = hn::MulAdd(ay, along, hn::MulAdd(by, across, hn::Set(df, cy)));
    hn::Store(sample(job.key[static_cast<std::size_t>(search.level)], px, py), df, patch->grey() + i);
  }
  const Rows d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  VR sum = hn::Zero(d), gradient = hn::Zero(d);
  for (int i = 0; i < kPatchRows * kRow; i += lanes) {
    sum = hn::MulAdd(hn::Load(d, kTables.all + i % kRow), hn::Load(d, patch->grey() + i), sum);
  }
  for (int i = 0; i < kPatchRows * kRow; i += lanes) {
    const VR slope = hn::Sub(hn::LoadU(d, patch->grey() + i + 1), hn::LoadU(d, patch->grey() + i - 1));
    const VR weight = hn::Load(d, kTables.inner + i % kRow);
    gradient = hn::MulAdd(hn::Mul(weight, slope), slope, gradient);
  }
  patch->mean = total(sum) / kPatchSamples;
  const float least = job.settings.image_noise / job.settings.max_texture_sigma_px;
  if (total(gradient) < 2 * least * least * 4 * kStep * kStep) return false;
  VR squares = hn::Zero(d);
  for (int i = 0; i < kPatchRows * kRow; i += lanes) {
    const VR weight = hn::Load(d, kTables.all + i % kRow);
    const VR centred = hn::Mul(weight, hn::Sub(hn::Load(d, patch->grey() + i), hn::Set(d, patch->mean)));
    squares = hn::MulAdd(centred, centred, squares);
    hn::Store(centred, d, patch->grey() + i);
  }
  const VR norm = hn::Set(d, 1 / std::sqrt(total(squares)));
  for (int i = 0; i < kPatchRows * kRow; i += lanes) {
    hn::Store(hn::Mul(norm, hn::Load(d, patch->grey() + i)), d, patch->grey() + i);
  }
  return true;
}

struct Strip {
  HWY_ALIGN float grey[kStripRows][kStripColumns];  ///< less the template's mean
  HWY_ALIGN float sums[kStripColumns];              ///< of each column's rows under the patch
  HWY_ALIGN float squares[kStripColumns];
};

/// The frame along the epipolar line, straightened.
HWY_INLINE void take_strip(const UpdateJob& job, const Search& search, float mean, Strip* strip) {
  const Floats df;
  const EpipolarLine& line = search.line;
  const float inverse_scale = 1 / search.scale;
  const float u = (line.u0 + search.first * line.ex + 0.5F) * inverse_scale - 0.5F;
  const float v = (line.v0 + search.first * line.ey + 0.5F) * inverse_scale - 0.5F;
  const int lanes = static_cast<int>(hn::Lanes(df));
  const int columns = search.steps + kPatchColumns - 1;
  const VF first = hn::MulAdd(hn::Iota(df, 0.0F), hn::Set(df, kStep), hn::Set(df, -kStep * (kPatchColumns / 2)));
  const VF offset = hn::Set(df, mean);
  for (int j = 0; j < kPatchRows + 2 * search.across; ++j) {
    const float across = static_cast<float>(j - kPatchRows / 2 - search.across);
    const VF row_u = hn::Set(df, u - across * line.ey), row_v = hn::Set(df, v + across * line.ex);
    for (int i = 0; i < columns; i += lanes) {
      const VF along = hn::Add(first, hn::Set(df, kStep * static_cast<float>(i)));
      const VF x = hn::MulAdd(along, hn::Set(df, line.ex), row_u), y = hn::MulAdd(along, hn::Set(df, line.ey), row_v);
      const VF grey = sample(job.frame[static_cast<std::size_t>(search.level)], x, y);
      hn::Store(hn::Sub(grey, offset), df, strip->grey[j] + i);
    }
  }
}

/// Zero-mean normalised correlation at every place of one line, `rows` below the strip's top.
HWY_INLINE void correlate(const Template& patch, const Search& search, int top, Strip* strip, float* scores) {
  const Floats df;
  const int lanes = static_cast<int>(hn::Lanes(df));
  const int columns = search.steps + kPatchColumns - 1;
  for (int i = 0; i < columns; i += lanes) {
    VF sum = hn::Zero(df), squares = hn::Zero(df);
    for (int j = 0; j < kPatchRows; ++j) {
      const VF grey = hn::Load(df, strip->grey[top + j] + i);
      sum = hn::Add(sum, grey);
      squares = hn::MulAdd(grey, grey, squares);
    }
    hn::Store(sum, df, strip->sums + i);
    hn::Store(squares, df, strip->squares + i);
  }
  for (int i = 0; i < search.steps; i += lanes) {
    VF product = hn::Zero(df), sum = hn::Zero(df), squares = hn::Zero(df);
    for (int k = 0; k < kPatchColumns; ++k) {
      for (int j = 0; j < kPatchRows; ++j) {
        product =
            hn::MulAdd(hn::Set(df, patch.grey()[j * kRow + k]), hn::LoadU(df, strip->grey[top + j] + i + k), product);
      }
      sum = hn::Add(sum, hn::LoadU(df, strip->sums + i + k));
      squares = hn::Add(squares, hn::LoadU(df, strip->squares + i + k));
    }
    const VF spread = hn::Sub(squares, hn::Mul(hn::Mul(sum, sum), hn::Set(df, 1.0F / kPatchSamples)));
    hn::StoreU(hn::Div(product, hn::Sqrt(hn::Max(spread, hn::Set(df, 1.0F)))), df, scores + i);
  }
}

/// The sums of MatchSums for the patch at the match.
HWY_INLINE MatchSums match_sums(const Template& patch, const Strip& strip, const Match& match) {
  constexpr float kInner = kPatchRows * (kPatchColumns - 2);
  const Rows d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  VR sum_a = hn::Zero(d), sum_b = hn::Zero(d);
  for (int j = 0; j < kPatchRows; ++j) {
    const float *a = patch.grey() + j * kRow, *b = strip.grey[match.line + j] + match.step;
    for (int i = 0; i < kRow; i += lanes) {
      const VR weight = hn::Load(d, kTables.inner + i);
      sum_a = hn::MulAdd(weight, hn::Load(d, a + i), sum_a);
      sum_b = hn::MulAdd(weight, hn::LoadU(d, b + i), sum_b);
    }
  }
  const VR mean_a = hn::Set(d, total(sum_a) / kInner), mean_b = hn::Set(d, total(sum_b) / kInner);
  VR aa = hn::Zero(d), bb = hn::Zero(d);
  for (int j = 0; j < kPatchRows; ++j) {
    const float *a = patch.grey() + j * kRow, *b = strip.grey[match.line + j] + match.step;
    for (int i = 0; i < kRow; i += lanes) {
      const VR weight = hn::Load(d, kTables.inner + i);
      const VR off_a = hn::Mul(weight, hn::Sub(hn::Load(d, a + i), mean_a));
      const VR off_b = hn::Mul(weight, hn::Sub(hn::LoadU(d, b + i), mean_b));
      aa = hn::MulAdd(off_a, off_a, aa);
      bb = hn::MulAdd(off_b, off_b, bb);
    }
  }
  const VR scale_a = hn::Set(d, 1 / std::sqrt(total(aa))), scale_b = hn::Set(d, 1 / std::sqrt(total(bb)));
  VR gg = hn::Zero(d), ge = hn::Zero(d), ee = hn::Zero(d), g_sum = hn::Zero(d);
  for (int j = 0; j < kPatchRows; ++j) {
    const float *a = patch.grey() + j * kRow, *b = strip.grey[match.line + j] + match.step;
    for (int i = 0; i < kRow; i += lanes) {
      const VR weight = hn::Load(d, kTables.inner + i);
      const VR e = hn::Mul(weight, hn::Sub(hn::Mul(scale_a, hn::Sub(hn::Load(d, a + i), mean_a)),
                                           hn::Mul(scale_b, hn::Sub(hn::LoadU(d, b + i), mean_b))));
      const VR slope_a = hn::Sub(hn::LoadU(d, a + i + 1), hn::LoadU(d, a + i - 1));
      const VR slope_b = hn::Sub(hn::LoadU(d, b + i + 1), hn::LoadU(d, b + i - 1));  // a match is never the first step
      const VR g = hn::Mul(hn::Mul(weight, hn::Set(d, 0.25F)), hn::MulAdd(scale_a, slope_a, hn::Mul(scale_b, slope_b)));
      gg = hn::MulAdd(g, g, gg);
      ge = hn::MulAdd(g, e, ge);
      ee = hn::MulAdd(e, e, ee);
      g_sum = hn::Add(g_sum, g);
    }
  }
  return {.gg = total(gg), .ge = total(ge), .ee = total(ee), .g = total(g_sum)};
}

int UpdatePixels(const UpdateJob& job, std::span<std::uint32_t> active, UpdateCounts* counts) {
  constexpr int kStride = kMaxSteps + kMaxLanes;
  Template patch;
  Strip strip;
  HWY_ALIGN float scores[(2 * kMaxAcross + 1) * kStride];
  const auto width = static_cast<std::uint32_t>(job.settings.width);
  std::size_t kept = 0;
  for (const std::uint32_t index : active) {
    // Neighbours have different turns, so that any few pixels together are looked at in every frame.
    if ((index % width + 2 * (index / width)) % job.turns != job.turn) {
      active[kept++] = index;
      continue;
    }
    ++counts->planned;
    const float x = static_cast<float>(index % width), y = static_cast<float>(index / width);
    PixelBelief& belief = job.beliefs[index];
    PixelState& state = job.states[index];
    const Search search = plan_search(job.geometry, job.settings, belief, x, y);
    PixelState outcome = PixelState::kUpdating;
    if (search.kind == Search::Kind::kNotVisible) {
      outcome = PixelState::kNotVisible;
      ++counts->not_visible;
    } else if (search.kind == Search::Kind::kSearch && take_template(job, search, x, y, &patch)) {
      take_strip(job, search, patch.mean, &strip);
      for (int o = 0; o <= 2 * search.across; ++o) correlate(patch, search, o, &strip, scores + o * kStride);
      Match match = best_match(search, job.settings, scores, kStride);
      if (match.kind == Match::Kind::kFound) {
        finish_match(search, match_sums(patch, strip, match), &match);
      }
      ++counts->searched;
      counts->samples += (search.steps + kPatchColumns - 1) * (kPatchRows + 2 * search.across);
      switch (match.kind) {
        case Match::Kind::kFound:
          belief = belief_after(belief, search, match, job.settings);
          ++counts->matched;
          break;
        case Match::Kind::kNone:
          if (!search.cut) belief = missed_belief(belief);
          outcome = search.cut ? PixelState::kNotVisible : PixelState::kNoMatch;
          break;
        case Match::Kind::kAmbiguous:
          ++counts->ambiguous;
          break;
      }
    }
    state = state_of(belief, job.settings, outcome);
    const bool done =
        state == PixelState::kDiverged || (state == PixelState::kConverged && settled(belief, job.settings));
    active[kept] = index;
    kept += done ? 0 : 1;
  }
  return static_cast<int>(kept);
}

const char* TargetName() { return hwy::TargetName(HWY_TARGET); }

}  // namespace HWY_NAMESPACE
}  // namespace vantage
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace vantage {

HWY_EXPORT(UpdatePixels);
HWY_EXPORT(TargetName);

int update_pixels(const UpdateJob& job, std::span<std::uint32_t> active, UpdateCounts* counts) {
  return HWY_DYNAMIC_DISPATCH(UpdatePixels)(job, active, counts);
}

const char* update_pixels_target() { return HWY_DYNAMIC_DISPATCH(TargetName)(); }

}  // namespace vantage
#endif
