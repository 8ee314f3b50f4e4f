#pragma once

#include <memory>
#include <vector>

#include "onboard/depth/depth_backend.h"
#include "onboard/depth/depth_options.h"
#include "onboard/depth/image_pyramid.h"
#include "onboard/depth/pixel_update.h"

namespace vantage {

class CudaPixels;

/// The filter on an NVIDIA GPU: one thread a pixel, the same arithmetic as on the CPU (pixel_update.h). Beliefs agree
/// with the CPU's to rounding, but where a score falls to the other side of a threshold. Built with -DVANTAGE_CUDA=ON.
class CudaDepthBackend : public DepthBackend {
 public:
  /// True when a device is there.
  static bool available();

  /// \pre the options are valid. \throws std::runtime_error with CUDA's reason when the device can't be had; so does
  /// every call when CUDA fails.
  CudaDepthBackend(int width, int height, const DepthFilterOptions& options);
  ~CudaDepthBackend() override;

  void start(const GreyImage& key_image, std::span<const PixelBelief> beliefs) override;
  UpdateCounts update(const GreyImage& image, const PairGeometry& geometry) override;
  void read(std::span<PixelBelief> beliefs, std::span<PixelState> states) const override;

 private:
  PixelSettings settings_;
  double samples_per_frame_;
  std::uint32_t turns_ = 1, turn_ = 0;
  ImagePyramid pyramid_;
  std::vector<PixelState> states_;  ///< to begin with; room kept
  std::unique_ptr<CudaPixels> pixels_;
};

}  // namespace vantage
