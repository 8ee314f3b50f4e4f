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

/// The key frame's patch, made to look as it would in the frame.
struct Template {
  HWY_ALIGN float grey[kPatchSamples + kMaxLanes];  ///< zero-mean, unit norm, row by row
  float mean;
  float gradient;  ///< sum of squared differences along the line, per px^2
};

/// Offsets of the patch's samples from its centre, row by row: along in steps, across in pixels.
struct PatchOffsets {
  HWY_ALIGN float along[kPatchSamples + kMaxLanes] = {};
  HWY_ALIGN float across[kPatchSamples + kMaxLanes] = {};
  constexpr PatchOffsets() {
    for (int i = 0; i < kPatchSamples; ++i) {
      along[i] = kStep * static_cast<float>(i % kPatchColumns - kPatchColumns / 2);
      across[i] = static_cast<float>(i / kPatchColumns - kPatchRows / 2);
    }
  }
};
constexpr PatchOffsets kOffsets;

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
  const int lanes = static_cast<int>(hn::Lanes(df));
  for (int i = 0; i < kPatchSamples; i += lanes) {
    const VF along = hn::Load(df, kOffsets.along + i), across = hn::Load(df, kOffsets.across + i);
    const VF px = hn::MulAdd(ax, along, hn::MulAdd(bx, across, hn::Set(df, cx)));
    const VF py = hn::MulAdd(ay, along, hn::MulAdd(by, across, hn::Set(df, cy)));
    hn::Store(sample(job.key[static_cast<std::size_t>(search.level)], px, py), df, patch->grey + i);
  }
  float sum = 0;
  for (int i = 0; i < kPatchSamples; ++i) sum += patch->grey[i];
  patch->mean = sum / kPatchSamples;
  float squares = 0, gradient = 0;
  for (int j = 0; j < kPatchRows; ++j) {
    float* row = patch->grey + j * kPatchColumns;
    for (int i = 0; i < kPatchColumns; ++i) {
      row[i] -= patch->mean;
      squares += row[i] * row[i];
    }
    for (int i = 1; i + 1 < kPatchColumns; ++i) {
      const float slope = row[i + 1] - row[i - 1];
      gradient += slope * slope;
    }
  }
  patch->gradient = gradient / (4 * kStep * kStep);
  const float least = job.settings.image_noise / job.settings.max_texture_sigma_px;
  if (patch->gradient < 2 * least * least) return false;
  const float norm = 1 / std::sqrt(squares);
  for (int i = 0; i < kPatchSamples; ++i) patch->grey[i] *= norm;
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
        product = hn::MulAdd(hn::Set(df, patch.grey[j * kPatchColumns + k]),
                             hn::LoadU(df, strip->grey[top + j] + i + k), product);
      }
      sum = hn::Add(sum, hn::LoadU(df, strip->sums + i + k));
      squares = hn::Add(squares, hn::LoadU(df, strip->squares + i + k));
    }
    const VF spread = hn::Sub(squares, hn::Mul(hn::Mul(sum, sum), hn::Set(df, 1.0F / kPatchSamples)));
    hn::StoreU(hn::Div(product, hn::Sqrt(hn::Max(spread, hn::Set(df, 1.0F)))), df, scores + i);
  }
}

int UpdatePixels(const UpdateJob& job, std::span<std::uint32_t> active, UpdateCounts* counts) {
  constexpr int kStride = kMaxSteps + kMaxLanes;
  Template patch;
  Strip strip;
  HWY_ALIGN float scores[(2 * kMaxAcross + 1) * kStride];
  const auto width = static_cast<std::uint32_t>(job.settings.width);
  std::size_t kept = 0;
  counts->planned += static_cast<int>(active.size());
  for (const std::uint32_t index : active) {
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
        finish_match(search, patch.grey, strip.grey[match.line] + match.step, kStripColumns, &match);
      }
      ++counts->searched;
      switch (match.kind) {
        case Match::Kind::kFound:
          belief = belief_after(belief, search, match, job.settings);
          ++counts->matched;
          break;
        case Match::Kind::kNone:
          belief = missed_belief(belief);
          outcome = PixelState::kNoMatch;
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
