#pragma once

#include <array>
#include <cstdint>
#include <istream>
#include <string>
#include <vector>

namespace vantage {

/// A leaf of an OctoMap: a cube of `edge` voxels from key `corner` (OctoMap's keys: 32768 is the world's origin).
struct OctomapLeaf {
  std::array<int, 3> corner;
  int edge;
  float log_odds;
};

/// What an .ot or .bt file of an OcTree says.
struct OctomapFile {
  double resolution_m = 0;
  std::vector<OctomapLeaf> leaves;
};

/// Reads OctoMap's two formats up to the end of the tree; what follows stays in the stream.
///
/// OctoMap's own reader trusts the file (a damaged one overruns the stack); this one holds every node against the
/// format: depth at most 16, as many nodes as the header says, finite values, nothing cut short. A binary file's free
/// and occupied leaves get `free` and `occupied`.
/// \throws InputError that starts with `name`.
OctomapFile read_octomap(std::istream& in, const std::string& name, float free, float occupied);

}  // namespace vantage
