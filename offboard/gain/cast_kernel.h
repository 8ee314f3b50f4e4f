#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "offboard/gain/cast_block.h"
#include "offboard/gain/gain_field.h"

namespace vantage {

/// Ways to cast rays through a GainField. All visit the same voxels; counts are equal to the bit, sums of entropies to
/// the rounding of single precision.
enum class CastKernel {
  kScalar,    ///< one ray at a time in double precision: the yardstick
  kPortable,  ///< four rays at once in the compiler's vectors: SSE2 on x86-64, NEON on 64-bit ARM
  kAvx2,      ///< eight rays at once
  kAvx512     ///< sixteen rays at once, tables in registers
};

std::string_view name_of(CastKernel kernel);
std::optional<CastKernel> parse_kernel(std::string_view name, std::string* why = nullptr);
/// What this program holds and this machine can run, slowest first.
std::vector<CastKernel> available_kernels();
CastKernel best_kernel();

/// The function of a kernel for a field of that layout. The kernel must be available.
CastBlocks cast_function(CastKernel kernel, GainField::Layout layout);

}  // namespace vantage
