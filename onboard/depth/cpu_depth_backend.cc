#include "onboard/depth/cpu_depth_backend.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <stdexcept>

namespace vantage {
namespace {

constexpr int kBandRows = 8;
constexpr std::uint32_t kFirstTurns = 2;  // a key frame's first searches are long

/// Standard deviation of an image's noise, grey levels: by the median of a second difference that no plane of grey
/// passes (Immerkaer, "Fast noise variance estimation", 1996, made robust). Texture makes it too high where it covers
/// more than half of the image.
float estimate_noise(const ImagePyramid::Level& image) {
  std::array<int, 4 * 512> histogram{};
  int count = 0;
  for (int y = 1; y + 1 < image.height; y += 2) {
    const std::uint8_t* row = image.pixels + static_cast<std::ptrdiff_t>(y) * image.stride;
    const std::uint8_t *above = row - image.stride, *below = row + image.stride;
    for (int x = 1; x + 1 < image.width; x += 2) {
      const int corners = above[x - 1] + above[x + 1] + below[x - 1] + below[x + 1];
      const int sides = above[x] + below[x] + row[x - 1] + row[x + 1];
      ++histogram[static_cast<std::size_t>(std::abs(corners - 2 * sides + 4 * row[x]))];
      ++count;
    }
  }
  int below_median = 0;
  std::size_t median = 0;
  while (median + 1 < histogram.size() && 2 * (below_median += histogram[median]) < count) ++median;
  return static_cast<float>(median) / (0.6745F * 6);  // a Gaussian's median of |x|; the weights' norm
}

}  // namespace

PixelSettings pixel_settings(const DepthFilterOptions& options, int width, int height) {
  const auto narrow = [](double value) { return static_cast<float>(value); };
  return {.width = width,
          .height = height,
          .levels = ImagePyramid::kLevels,
          .nearest = narrow(1 / options.min_depth_m),
          .farthest = narrow(1 / options.max_depth_m),
          .converged_sigma = narrow(options.converged_relative_sigma),
          .converged_ratio = narrow(options.converged_inlier_ratio),
          .diverged_ratio = narrow(options.diverged_inlier_ratio),
          .settled_sigma = narrow(options.settled_relative_sigma),
          .min_correlation = narrow(options.min_correlation),
          .image_noise = narrow(options.image_noise),
          .min_variance_px2 = narrow(options.min_match_sigma_px * options.min_match_sigma_px),
          .max_texture_sigma_px = narrow(options.max_texture_sigma_px)};
}

CpuDepthBackend::CpuDepthBackend(int width, int height, const DepthFilterOptions& options, WorkerPool* pool)
    : pool_(pool), samples_per_frame_(options.samples_per_frame), key_(width, height), frame_(width, height) {
  const std::size_t pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  beliefs_.resize(pixels);
  states_.resize(pixels);
  active_.resize(pixels);
  job_.settings = pixel_settings(options, width, height);
  job_.beliefs = beliefs_.data();
  job_.states = states_.data();
  for (int l = 0; l < ImagePyramid::kLevels; ++l) {
    job_.key[static_cast<std::size_t>(l)] = key_.level(l);
    job_.frame[static_cast<std::size_t>(l)] = frame_.level(l);
  }
  for (int row = 0; row < height; row += kBandRows) {
    Band band;
    band.first = static_cast<std::size_t>(row) * static_cast<std::size_t>(width);
    band.first_row = row;
    band.end_row = std::min(height, row + kBandRows);
    bands_.push_back(band);
  }
}

void CpuDepthBackend::start(const GreyImage& key_image, std::span<const PixelBelief> beliefs) {
  if (beliefs.size() != beliefs_.size()) throw std::invalid_argument("CpuDepthBackend: a belief a pixel is needed");
  key_.build(key_image);
  job_.turns = kFirstTurns;
  noise_ = std::min(job_.settings.image_noise, estimate_noise(key_.level(0)));
  std::copy(beliefs.begin(), beliefs.end(), beliefs_.begin());
  const int width = job_.settings.width, height = job_.settings.height;
  for (Band& band : bands_) {
    band.active = 0;
    find_texture(band.first_row, band.end_row);
    for (int y = band.first_row; y < band.end_row; ++y) {
      const bool row_inside = y >= kBorder && y < height - kBorder;
      for (int x = 0; x < width; ++x) {
        const std::size_t index =
            static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
        if (!row_inside || x < kBorder || x >= width - kBorder) {
          states_[index] = PixelState::kBorder;
        } else if (states_[index] != PixelState::kNoTexture) {
          active_[band.first + band.active++] = static_cast<std::uint32_t>(index);
        }
      }
    }
  }
}

/// kNoTexture where the gradient of a patch, whatever the line's direction, leaves the place too uncertain; kUpdating
/// elsewhere.
void CpuDepthBackend::find_texture(int first_row, int end_row) {
  const ImagePyramid::Level image = key_.level(0);
  const float least = noise_ / job_.settings.max_texture_sigma_px;
  // What noise alone makes of the sum of squared gradients, and as much as it takes for the larger eigenvalue of 99 in
  // 100 patches of noise to stay below.
  const float noise_energy = 2.5F * 0.5F * kPatchRows * kPatchRows * noise_ * noise_;
  const float least_energy = noise_energy + 2 * least * least;
  for (int y = first_row; y < end_row; ++y) {
    for (int x = 0; x < image.width; ++x) {
      PixelState& state =
          states_[static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width) + static_cast<std::size_t>(x)];
      state = PixelState::kUpdating;
      if (y < kBorder || y >= image.height - kBorder || x < kBorder || x >= image.width - kBorder) continue;
      float xx = 0, xy = 0, yy = 0;
      for (int v = y - kPatchRows / 2; v <= y + kPatchRows / 2; ++v) {
        const std::uint8_t* row = image.pixels + static_cast<std::ptrdiff_t>(v) * image.stride + x;
        for (int u = -(kPatchRows / 2); u <= kPatchRows / 2; ++u) {
          const float gx = 0.5F * static_cast<float>(row[u + 1] - row[u - 1]);
          const float gy = 0.5F * static_cast<float>(row[u + image.stride] - row[u - image.stride]);
          xx += gx * gx;
          xy += gx * gy;
          yy += gy * gy;
        }
      }
      // The larger eigenvalue of the structure tensor: the gradient along the best direction.
      const float mean = 0.5F * (xx + yy), off = 0.5F * (xx - yy);
      if (mean + std::sqrt(off * off + xy * xy) < least_energy) state = PixelState::kNoTexture;
    }
  }
}

UpdateCounts CpuDepthBackend::update(const GreyImage& image, const PairGeometry& geometry) {
  frame_.build(image);
  job_.geometry = geometry;
  job_.turn = (job_.turn + 1) % job_.turns;
  pool_->run(static_cast<int>(bands_.size()), [this](int chunk) {
    Band& band = bands_[static_cast<std::size_t>(chunk)];
    band.counts = {};
    const std::span<std::uint32_t> active(active_.data() + band.first, band.active);
    band.active = static_cast<std::size_t>(update_pixels(job_, active, &band.counts));
    const std::size_t width = static_cast<std::size_t>(job_.settings.width);
    const std::size_t end = static_cast<std::size_t>(band.end_row) * width;
    for (std::size_t i = static_cast<std::size_t>(band.first_row) * width; i < end; ++i) {
      ++band.counts.states[static_cast<std::size_t>(states_[i])];
    }
  });
  UpdateCounts total;
  for (const Band& band : bands_) {
    for (std::size_t s = 0; s < kPixelStates; ++s) total.states[s] += band.counts.states[s];
    total.planned += band.counts.planned;
    total.not_visible += band.counts.not_visible;
    total.samples += band.counts.samples;
    total.searched += band.counts.searched;
    total.matched += band.counts.matched;
    total.ambiguous += band.counts.ambiguous;
  }
  // The next frame's searches will be about as long as this one's.
  const double whole = total.samples * job_.turns;
  job_.turns = static_cast<std::uint32_t>(std::clamp(std::ceil(whole / samples_per_frame_), 1.0, 4.0));
  return total;
}

void CpuDepthBackend::read(std::span<PixelBelief> beliefs, std::span<PixelState> states) const {
  if (beliefs.size() != beliefs_.size() || states.size() != states_.size()) {
    throw std::invalid_argument("CpuDepthBackend: room for every pixel is needed");
  }
  std::copy(beliefs_.begin(), beliefs_.end(), beliefs.begin());
  std::copy(states_.begin(), states_.end(), states.begin());
}

}  // namespace vantage
