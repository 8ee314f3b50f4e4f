#pragma once

// The GPU's half of CudaDepthBackend, in C++17 for the toolkits of older Jetsons. Plain arrays, no exceptions: every
// call returns null, or what CUDA says went wrong.

#include <cstdint>

#include "onboard/depth/pixel_update.h"

namespace vantage {

/// One level of an image pyramid in the host's memory.
struct HostLevel {
  const std::uint8_t* pixels = nullptr;
  int width = 0, height = 0, stride = 0;
};

/// Sums over the pixels of one update.
struct CudaCounts {
  int states[kPixelStates] = {};
  int planned = 0, not_visible = 0, searched = 0, matched = 0, ambiguous = 0;
  unsigned long long samples = 0;
};

class CudaPixels {
 public:
  static constexpr int kLevels = 3;

  /// True when a device is there that can run this.
  static bool available();

  CudaPixels() = default;
  ~CudaPixels();
  CudaPixels(const CudaPixels&) = delete;
  CudaPixels& operator=(const CudaPixels&) = delete;

  const char* create(const PixelSettings& settings);
  const char* start(const HostLevel (&key)[kLevels], const PixelBelief* beliefs, const PixelState* states);
  const char* update(const HostLevel (&frame)[kLevels], const PairGeometry& geometry, std::uint32_t turns,
                     std::uint32_t turn, CudaCounts* counts);
  const char* read(PixelBelief* beliefs, PixelState* states) const;

 private:
  struct Device;
  Device* device_ = nullptr;
};

}  // namespace vantage
