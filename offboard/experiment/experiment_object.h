#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "drivers/sim/mesh.h"

namespace vantage {

/// Something to reconstruct.
struct ExperimentObject {
  std::string name;            ///< in tables and file names: letters, digits, '_' and '-'
  std::filesystem::path file;  ///< the mesh
  std::string digest;          ///< of the file's bytes, 16 hexadecimal digits
  sim::Mesh mesh;
};

/// First 16 hexadecimal digits of the digest of a file's bytes.
std::string digest_of_file(const std::filesystem::path& file);

/// `item`: teapot, bunny or dragon, which scripts/fetch-models puts into `models`; else a mesh file, whose object is
/// called like the file without its ending. \throws InputError naming the item when it can't be used.
ExperimentObject load_object(const std::string& item, const std::filesystem::path& models);

/// All of them. \throws InputError as load_object does, for an empty list, and for two objects of one name.
std::vector<ExperimentObject> load_objects(const std::vector<std::string>& items, const std::filesystem::path& models);

}  // namespace vantage
