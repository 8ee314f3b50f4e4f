#include "onboard/depth/cuda_depth_backend.h"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "onboard/depth/cpu_depth_backend.h"
#include "onboard/depth/cuda_pixels.h"
#include "onboard/depth/key_states.h"

namespace vantage {
namespace {

static_assert(CudaPixels::kLevels == ImagePyramid::kLevels);

void check(const char* error) {
  if (error != nullptr) throw std::runtime_error(std::string("CUDA: ") + error);
}

void describe(const ImagePyramid& pyramid, HostLevel (&levels)[CudaPixels::kLevels]) {
  for (int l = 0; l < CudaPixels::kLevels; ++l) {
    const ImagePyramid::Level level = pyramid.level(l);
    levels[l] = {level.pixels, level.width, level.height, level.stride};
  }
}

}  // namespace

bool CudaDepthBackend::available() { return CudaPixels::available(); }

CudaDepthBackend::CudaDepthBackend(int width, int height, const DepthFilterOptions& options)
    : settings_(pixel_settings(options, width, height)),
      samples_per_frame_(options.samples_per_frame),
      pyramid_(width, height),
      states_(static_cast<std::size_t>(width) * static_cast<std::size_t>(height)),
      pixels_(std::make_unique<CudaPixels>()) {
  check(pixels_->create(settings_));
}

CudaDepthBackend::~CudaDepthBackend() = default;

void CudaDepthBackend::start(const GreyImage& key_image, std::span<const PixelBelief> beliefs) {
  if (beliefs.size() != states_.size()) throw std::invalid_argument("CudaDepthBackend: a belief a pixel is needed");
  pyramid_.build(key_image);
  find_key_states(pyramid_.level(0), settings_, states_);
  turns_ = kFirstTurns;
  HostLevel levels[CudaPixels::kLevels];
  describe(pyramid_, levels);
  check(pixels_->start(levels, beliefs.data(), states_.data()));
}

UpdateCounts CudaDepthBackend::update(const GreyImage& image, const PairGeometry& geometry) {
  pyramid_.build(image);
  turn_ = (turn_ + 1) % turns_;
  HostLevel levels[CudaPixels::kLevels];
  describe(pyramid_, levels);
  CudaCounts sums;
  check(pixels_->update(levels, geometry, turns_, turn_, &sums));
  UpdateCounts counts;
  std::copy(std::begin(sums.states), std::end(sums.states), counts.states.begin());
  counts.planned = sums.planned;
  counts.not_visible = sums.not_visible;
  counts.samples = static_cast<double>(sums.samples);
  counts.searched = sums.searched;
  counts.matched = sums.matched;
  counts.ambiguous = sums.ambiguous;
  turns_ = next_turns(counts.samples, turns_, samples_per_frame_);
  return counts;
}

void CudaDepthBackend::read(std::span<PixelBelief> beliefs, std::span<PixelState> states) const {
  if (beliefs.size() != states_.size() || states.size() != states_.size()) {
    throw std::invalid_argument("CudaDepthBackend: room for every pixel is needed");
  }
  check(pixels_->read(beliefs.data(), states.data()));
}

}  // namespace vantage
