#pragma once

#include <cstdint>
#include <vector>

#include "onboard/depth/depth_backend.h"
#include "onboard/depth/depth_options.h"
#include "onboard/depth/image_pyramid.h"
#include "onboard/depth/update_pixels.h"
#include "onboard/depth/worker_pool.h"

namespace vantage {

/// The filter on the CPU: vectors within a pixel's search, threads over bands of rows, settled pixels skipped.
/// The result does not depend on the number of threads.
class CpuDepthBackend : public DepthBackend {
 public:
  /// \pre the options are valid; the image is at least 32 x 32. `pool` must outlive the backend.
  CpuDepthBackend(int width, int height, const DepthFilterOptions& options, WorkerPool* pool);

  void start(const GreyImage& key_image, std::span<const PixelBelief> beliefs) override;
  UpdateCounts update(const GreyImage& image, const PairGeometry& geometry) override;
  void read(std::span<PixelBelief> beliefs, std::span<PixelState> states) const override;

 private:
  /// Some rows of the key frame: their active pixels and how the last update went.
  struct Band {
    std::size_t first = 0;  ///< in active_
    std::size_t active = 0;
    int first_row = 0, end_row = 0;
    UpdateCounts counts{};
  };

  WorkerPool* pool_;
  double samples_per_frame_;
  ImagePyramid key_, frame_;
  UpdateJob job_;
  std::vector<PixelBelief> beliefs_;
  std::vector<PixelState> states_;
  std::vector<std::uint32_t> active_;
  std::vector<Band> bands_;
};

/// As the inner loop takes them.
PixelSettings pixel_settings(const DepthFilterOptions& options, int width, int height);

}  // namespace vantage
