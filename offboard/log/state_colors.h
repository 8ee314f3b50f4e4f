#pragma once

#include <array>
#include <cstdint>

#include "lcmtypes/link/depth_map.h"

namespace vantage {

/// What stands for a pixel's state in exported images: red, green, blue.
inline std::array<std::uint8_t, 3> color_of(DepthState state) {
  switch (state) {
    case DepthState::kConverged:
      return {0, 158, 115};  // green
    case DepthState::kEdge:
      return {230, 159, 0};  // orange
    case DepthState::kUpdating:
      return {86, 180, 233};  // blue
    case DepthState::kDiverged:
      return {213, 94, 0};  // red
    case DepthState::kInvalid:
      break;
  }
  return {0, 0, 0};
}

/// True when depth and sigma mean something.
inline bool has_depth(DepthState state) { return state != DepthState::kInvalid && state != DepthState::kDiverged; }

}  // namespace vantage
