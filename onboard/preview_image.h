#pragma once

#include <vantage/preview_t.hpp>

#include "drivers/camera/frame_source.h"

namespace vantage {

/// A frame's (left) image as a JPEG of at most 320 pixels' width, for people: 3 to 20 kB, one datagram. `utime` and
/// `session` are left to the caller. \pre the image is not empty
preview_t preview_of(const GreyImage& image);

}  // namespace vantage
