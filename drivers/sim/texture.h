#pragma once

#include <cstdint>

namespace vantage::sim {

/// Four floats side by side: the four samples of a pixel are shaded together. A GCC and Clang vector, compiled for
/// whatever the target has.
typedef float Float4 __attribute__((vector_size(16)));

/// Share of light, in [0.04, 0.96], that a solid speckle pattern reflects at four points of space (m).
///
/// Five octaves of value noise (cells of 2.5 to 80 mm) on hashed lattices: it never repeats inside a room, so that a
/// block matcher finds one true match and no periodic false ones. An octave fades out where its cells come near the
/// size of a pixel on the surface, `footprint_m`, for a finer one could only be seen as flicker. Same arguments, same
/// bits. Method: Perlin, "An image synthesizer", 1985; Worley and Ebert, "Texturing and Modeling", 2003.
Float4 solid_texture(Float4 x, Float4 y, Float4 z, Float4 footprint_m, std::uint32_t seed);

}  // namespace vantage::sim
