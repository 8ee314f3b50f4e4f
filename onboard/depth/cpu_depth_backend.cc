#include "onboard/depth/cpu_depth_backend.h"

#include <algorithm>
#include <stdexcept>

#include "onboard/depth/key_states.h"

namespace vantage {
namespace {

constexpr int kBandRows = 8;

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
  std::copy(beliefs.begin(), beliefs.end(), beliefs_.begin());
  find_key_states(key_.level(0), job_.settings, states_);
  for (Band& band : bands_) {
    band.active = 0;
    const std::size_t width = static_cast<std::size_t>(job_.settings.width);
    for (std::size_t i = band.first; i < static_cast<std::size_t>(band.end_row) * width; ++i) {
      if (states_[i] == PixelState::kUpdating) active_[band.first + band.active++] = static_cast<std::uint32_t>(i);
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
  job_.turns = next_turns(total.samples, job_.turns, samples_per_frame_);
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
