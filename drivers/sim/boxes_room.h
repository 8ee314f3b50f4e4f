#pragma once

#include <cstdint>

#include "drivers/sim/world.h"

namespace vantage::sim {

/// A world for a moving camera: a textured room with a dozen textured boxes of 8 to 45 cm, turned about the vertical,
/// standing on the ground within 0.9 m of the origin. Another seed, another room.
World boxes_room(std::uint32_t seed);

}  // namespace vantage::sim
