#pragma once

// One pixel's update, less the reading of images: what to search, what the correlations say, what is believed then.
// The CPU's and CUDA's code share it.

#include <cmath>
#include <cstdint>

#include "onboard/depth/epipolar_line.h"
#include "onboard/depth/host_device.h"
#include "onboard/depth/pixel_belief.h"
#include "onboard/depth/pixel_state.h"

namespace vantage {

// The patch lies along the epipolar line: kPatchColumns samples along it, kPatchRows across, kStep pixels apart along
// and one pixel across.
inline constexpr int kPatchRows = 5;
inline constexpr int kPatchColumns = 7;
inline constexpr int kPatchSamples = kPatchRows * kPatchColumns;
inline constexpr float kStep = 0.8F;

inline constexpr int kMaxSteps = 64;  ///< places tried along a line; a longer search takes a coarser pyramid level
inline constexpr int kMaxAcross = 2;  ///< lines tried to either side, as the pose's uncertainty asks
inline constexpr int kBorder = 6;     ///< pixels at the image's edge that have no room for a patch

/// DepthFilterOptions and the image's size, as the inner loop takes them.
struct PixelSettings {
  int width = 0, height = 0;
  int levels = 1;
  float nearest = 0, farthest = 0;  ///< inverse depths, 1/m: nearest > farthest
  float converged_sigma = 0, converged_ratio = 0, diverged_ratio = 0, settled_sigma = 0;
  float min_correlation = 0;
  float image_noise = 0;
  float min_variance_px2 = 0;
  float max_texture_sigma_px = 0;
};

/// Where to look for a pixel.
struct Search {
  enum class Kind : std::uint8_t { kNotVisible, kNothingToLearn, kSearch };
  Kind kind = Kind::kNotVisible;
  EpipolarLine line;
  int level = 0;     ///< of the pyramid
  float scale = 1;   ///< 2^level: pixels of the image in one of the level
  int across = 0;    ///< lines to either side
  float first = 0;   ///< s of the first place, image pixels
  int steps = 0;     ///< places, kStep * scale apart
  bool cut = false;  ///< a part of where the match may be lies outside the image: to find none tells nothing
};

/// Shrinks [low, high], pixels along the line, to where `position + s * direction` is at least `margin` inside an
/// extent of `size` pixels.
VANTAGE_HOST_DEVICE inline void clip_to_image(float position, float direction, float margin, float size, float* low,
                                              float* high) {
  const float begin = margin, end = size - 2 - margin;
  if (std::fabs(direction) < 1e-6F) {
    if (position < begin || position > end) *high = *low - 1;
    return;
  }
  float a = (begin - position) / direction, b = (end - position) / direction;
  if (a > b) {
    const float swap = a;
    a = b;
    b = swap;
  }
  if (a > *low) *low = a;
  if (b < *high) *high = b;
}

VANTAGE_HOST_DEVICE inline Search plan_search(const PairGeometry& geometry, const PixelSettings& settings,
                                              const PixelBelief& belief, float x, float y) {
  Search search;
  EpipolarLine& line = search.line;
  if (!epipolar_line(geometry, x, y, belief.mean, &line)) return search;
  const float width = static_cast<float>(settings.width), height = static_cast<float>(settings.height);
  if (line.u0 < kBorder || line.v0 < kBorder || line.u0 > width - 1 - kBorder || line.v0 > height - 1 - kBorder) {
    return search;
  }

  // A match tells something only where inverse depth moves the place by more than the match is uncertain.
  const float sigma = std::sqrt(belief.variance);
  const float slope = line.slope();
  const float match_px = std::sqrt(settings.min_variance_px2 + line.variance_along_px2);
  if (3 * sigma * slope < match_px) {
    search.kind = Search::Kind::kNothingToLearn;
    return search;
  }

  const float pad = 2 * kStep + 2 * std::sqrt(line.variance_along_px2);
  const float far_end = std::fmax(belief.mean - 3 * sigma, settings.farthest);
  float near_end = std::fmin(belief.mean + 3 * sigma, settings.nearest);
  // Where the camera moves forward, a near point may pass it: keep to what is in front.
  if (line.tz < 0) near_end = std::fmin(near_end, belief.mean + 0.8F * line.z0 / -line.tz);
  float low = line.along(far_end) - pad, high = line.along(near_end) + pad;

  while (search.level + 1 < settings.levels && high - low > kStep * search.scale * kMaxSteps) {
    ++search.level;
    search.scale *= 2;
  }
  const float across = std::sqrt(line.variance_across_px2) / search.scale;
  search.across = across < 0.35F ? 0 : across < 0.9F ? 1 : kMaxAcross;

  const float margin =
      search.scale * (0.5F * kStep * kPatchColumns + 0.5F * kPatchRows + static_cast<float>(search.across));
  const float wanted = high - low;
  clip_to_image(line.u0, line.ex, margin, width, &low, &high);
  clip_to_image(line.v0, line.ey, margin, height, &low, &high);
  if (!(high > low)) return search;
  search.cut = high - low < wanted;
  // A search that is still too long keeps the middle: the mean is the likeliest.
  const float longest = kStep * search.scale * (kMaxSteps - 1);
  if (high - low > longest) {
    low = std::fmax(low, std::fmin(-0.5F * longest, high - longest));
    high = low + longest;
  }
  search.kind = Search::Kind::kSearch;
  search.first = low;
  search.steps = static_cast<int>((high - low) / (kStep * search.scale)) + 1;
  return search;
}

/// What the correlations along a line say.
struct Match {
  enum class Kind : std::uint8_t { kNone, kAmbiguous, kFound };
  Kind kind = Kind::kNone;
  int line = 0;            ///< of the best place: 0 .. 2 across
  int step = 0;            ///< and its number along the line
  float s = 0;             ///< pixels along the line
  float variance_px2 = 0;  ///< of s, from the image alone
};

/// Reads the best place out of zero-mean normalised correlations; scores of line `o` (0 .. 2 across) begin at
/// `scores + o * stride`. To a whole step: `finish_match` does the rest.
VANTAGE_HOST_DEVICE inline Match best_match(const Search& search, const PixelSettings& settings, const float* scores,
                                            int stride) {
  Match match;
  int best_line = 0, best = 0;
  float highest = -1;
  for (int o = 0; o <= 2 * search.across; ++o) {
    for (int i = 0; i < search.steps; ++i) {
      if (scores[o * stride + i] > highest) {
        highest = scores[o * stride + i];
        best_line = o;
        best = i;
      }
    }
  }
  if (highest < settings.min_correlation || best == 0 || best == search.steps - 1) return match;

  // Another peak that the noise could make the best one: the place is not known.
  const float* line = scores + best_line * stride;
  const float rival = highest - std::fmax(0.03F, 1.0F * (1 - highest));
  for (int i = 1; i + 1 < search.steps; ++i) {
    const bool apart = i < best - 2 || i > best + 2;
    if (apart && line[i] > rival && line[i] >= line[i - 1] && line[i] >= line[i + 1]) {
      match.kind = Match::Kind::kAmbiguous;
      return match;
    }
  }
  match.kind = Match::Kind::kFound;
  match.line = best_line;
  match.step = best;
  return match;
}

/// Sums over the inner kPatchRows x (kPatchColumns - 2) samples of two patches a (key frame) and b (frame), each
/// brought to mean 0 and norm 1, with their difference e = a - b and their mean gradient g, per step along the line.
struct MatchSums {
  float gg = 0, ge = 0, ee = 0, g = 0;
};

/// Places a match within its step, by one Gauss-Newton step on the grey values with gradients of both patches (to
/// second order: Benhimane and Malis, "Real-time image-based tracking of planes", 2004), gain and offset taken out of
/// both; its variance is least squares' own.
VANTAGE_HOST_DEVICE inline void finish_match(const Search& search, const MatchSums& sums, Match* match) {
  constexpr int kInner = kPatchRows * (kPatchColumns - 2);
  const float gg = sums.gg - sums.g * sums.g / kInner;  // e has no mean, so ge needs no correction
  const float shift = sums.ge / gg;
  if (!(gg > 0) || !(std::fabs(shift) < 1.5F)) {
    match->kind = Match::Kind::kAmbiguous;
    return;
  }
  const float step = kStep * search.scale;
  const float residual = std::fmax(sums.ee - sums.ge * shift, 0.0F) / (kInner - 3);
  match->s = search.first + step * (static_cast<float>(match->step) + shift);
  match->variance_px2 = step * step * residual / gg;
}

/// The belief after a match was found.
VANTAGE_HOST_DEVICE inline PixelBelief belief_after(const PixelBelief& belief, const Search& search, const Match& match,
                                                    const PixelSettings& settings) {
  const EpipolarLine& line = search.line;
  const float floor_px2 = settings.min_variance_px2 * search.scale * search.scale;
  const float variance_px2 = match.variance_px2 + floor_px2 + line.variance_along_px2;
  const float slope = line.slope();
  const float measured = line.inverse_depth(match.s);
  PixelBelief next =
      updated_belief(belief, measured, variance_px2 / (slope * slope), settings.nearest - settings.farthest);
  // Matches of one patch err alike: many of them are not better than a part of the best one's floor.
  const float least = 0.25F * floor_px2 / (slope * slope);
  next.variance = std::fmax(next.variance, std::fmin(belief.variance, least));
  next.mean = std::fmin(std::fmax(next.mean, settings.farthest), settings.nearest);
  return next;
}

/// Converged or diverged, where the belief says so; else `otherwise`.
VANTAGE_HOST_DEVICE inline PixelState state_of(const PixelBelief& belief, const PixelSettings& settings,
                                               PixelState otherwise) {
  const float ratio = belief.inlier_ratio();
  if (!(ratio >= settings.diverged_ratio)) return PixelState::kDiverged;
  const float limit = settings.converged_sigma * belief.mean;
  if (ratio > settings.converged_ratio && belief.variance < limit * limit) return PixelState::kConverged;
  return otherwise;
}

/// True when more matches would tell nothing new.
VANTAGE_HOST_DEVICE inline bool settled(const PixelBelief& belief, const PixelSettings& settings) {
  const float limit = settings.settled_sigma * belief.mean;
  return belief.variance < limit * limit;
}

}  // namespace vantage
