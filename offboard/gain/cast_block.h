#pragma once

#include <cstddef>

#include "offboard/gain/ray_packet.h"
#include "offboard/gain/ray_sums.h"
#include "offboard/gain/visit_code.h"

namespace vantage {

/// Rays are cast and summed in blocks of this many: a block's sums depend on nothing else, and a view's are the blocks'
/// in order, so that threads and incremental evaluation can't change a bit.
constexpr std::size_t kRaysPerBlock = 16;

/// Casts block `block` of the bundle and returns its sums (`rays` left 0).
using CastBlock = RaySums (*)(const FieldView& field, const GridWalk& walk, const RayColumns& rays, std::size_t block);

/// The same for several blocks: `sums[i]` is that of `blocks[i]`, whatever the others are.
using CastBlocks = void (*)(const FieldView& field, const GridWalk& walk, const RayColumns& rays,
                            const std::size_t* blocks, std::size_t count, RaySums* sums);

// One file each, compiled for its instruction set. These files include neither Eigen nor containers: an inline function
// compiled for AVX-512 could otherwise end up in code that runs on lesser machines.
RaySums cast_flat_scalar(const FieldView&, const GridWalk&, const RayColumns&, std::size_t block);
RaySums cast_flat_portable(const FieldView&, const GridWalk&, const RayColumns&, std::size_t block);
RaySums cast_flat_avx2(const FieldView&, const GridWalk&, const RayColumns&, std::size_t block);
RaySums cast_flat_avx512(const FieldView&, const GridWalk&, const RayColumns&, std::size_t block);
RaySums cast_bricks_scalar(const FieldView&, const GridWalk&, const RayColumns&, std::size_t block);
void cast_bricks_avx512(const FieldView&, const GridWalk&, const RayColumns&, const std::size_t* blocks,
                        std::size_t count, RaySums* sums);

}  // namespace vantage
