#include "drivers/sim/texture.h"

namespace vantage::sim {
namespace {

typedef std::int32_t Int4 __attribute__((vector_size(16)));
typedef std::uint32_t Uint4 __attribute__((vector_size(16)));

struct Octave {
  float cell_m;
  float amplitude;
};

/// Block matching between 0.4 and 3 m wants contrast at 0.9 to 7 mm a pixel: each octave serves about a doubling of the
/// distance. The ratio of the cells is no integer, so that their lattices never fall together.
constexpr Octave kOctaves[] = {{0.0025F, 0.30F}, {0.006F, 0.30F}, {0.014F, 0.28F}, {0.033F, 0.22F}, {0.080F, 0.18F}};

constexpr float kMean = 0.5F, kLowest = 0.04F, kHighest = 0.96F;

/// Large odd numbers, one an axis, which spread lattice coordinates over all bits.
constexpr std::uint32_t kPrimeX = 0x9E3779B1U, kPrimeY = 0x85EBCA77U, kPrimeZ = 0xC2B2AE3DU;

Float4 splat(float value) { return Float4{value, value, value, value}; }
Float4 lesser(Float4 a, Float4 b) { return a < b ? a : b; }
Float4 greater(Float4 a, Float4 b) { return a > b ? a : b; }
Float4 smoothstep(Float4 t) { return t * t * (3.0F - 2.0F * t); }
Float4 lerp(Float4 a, Float4 b, Float4 t) { return a + t * (b - a); }

/// Mixes the bits of a lattice point's number to a value in [-1, 1).
Float4 lattice_value(Uint4 h) {
  h ^= h >> 15;
  h *= 0x2C1B3C6DU;
  h ^= h >> 12;
  h *= 0x297A2D39U;
  h ^= h >> 15;
  return __builtin_convertvector(reinterpret_cast<Int4&>(h), Float4) * 0x1p-31F;
}

/// Splits a coordinate into its lattice cell's hash and the smooth weight of the cell's far side.
void split(Float4 coordinate, std::uint32_t prime, Uint4* hash, Float4* weight) {
  Int4 cell = __builtin_convertvector(coordinate, Int4);
  Float4 fraction = coordinate - __builtin_convertvector(cell, Float4);
  const Int4 below = fraction < 0.0F;  // -1 where truncation went up
  cell += below;
  fraction -= __builtin_convertvector(below, Float4);
  *hash = __builtin_convertvector(cell, Uint4) * prime;
  *weight = smoothstep(fraction);
}

Float4 value_noise(Float4 x, Float4 y, Float4 z, std::uint32_t seed) {
  Uint4 hx, hy, hz;
  Float4 wx, wy, wz;
  split(x, kPrimeX, &hx, &wx);
  split(y, kPrimeY, &hy, &wy);
  split(z, kPrimeZ, &hz, &wz);
  const auto edge = [&](Uint4 h) { return lerp(lattice_value(hx ^ h), lattice_value((hx + kPrimeX) ^ h), wx); };
  const auto face = [&](Uint4 h) { return lerp(edge(hy ^ h), edge((hy + kPrimeY) ^ h), wy); };
  return lerp(face(hz ^ seed), face((hz + kPrimeZ) ^ seed), wz);
}

}  // namespace

Float4 solid_texture(Float4 x, Float4 y, Float4 z, Float4 footprint_m, std::uint32_t seed) {
  Float4 reflectance = splat(kMean);
  std::uint32_t octave_seed = seed * 0x9E3779B1U;
  for (const auto& [cell_m, amplitude] : kOctaves) {
    octave_seed = (octave_seed ^ (octave_seed >> 15)) * 0x2C1B3C6DU + 0x68E31DA5U;
    // Fades in as a cell grows from one pixel to two.
    const Float4 sharpness = cell_m / footprint_m - 1.0F;
    const Float4 fade = smoothstep(lesser(greater(sharpness, splat(0)), splat(1)));
    if (fade[0] + fade[1] + fade[2] + fade[3] == 0) continue;
    // The shift keeps ground and walls, which lie on round coordinates, off the lattice planes of every octave.
    const float scale = 1 / cell_m, shift = 0.37F + static_cast<float>(octave_seed >> 24);
    const Float4 noise = value_noise(x * scale + shift, y * scale + shift, z * scale + shift, octave_seed);
    reflectance += amplitude * fade * noise;
  }
  return lesser(greater(reflectance, splat(kLowest)), splat(kHighest));
}

}  // namespace vantage::sim
