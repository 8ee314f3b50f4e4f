#include "drivers/sim/mesh.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstring>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>

#include <assimp/Importer.hpp>
#include <assimp/config.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include "calib/files/input_error.h"
#include "calib/files/ply.h"

namespace vantage::sim {
namespace {

[[noreturn]] void fail(const std::filesystem::path& path, const std::string& fault) {
  throw InputError(path.string() + ": " + fault);
}

/// Assimp's messages run over several lines; ours have one.
std::string one_line(std::string text) {
  for (char& c : text) {
    if (std::isspace(static_cast<unsigned char>(c))) c = ' ';
  }
  return text;
}

void check_readable(const std::filesystem::path& path) {
  std::error_code error;
  if (!std::filesystem::exists(path, error)) {
    fail(path, "no such mesh file; scripts/fetch-models fetches the teapot into models/");
  }
  if (!std::filesystem::is_regular_file(path, error))
    fail(path, "is not a file; give a PLY, OBJ, GLB, STL or OFF mesh");
  if (!std::ifstream(path)) fail(path, "can't be read; check its permissions");
}

std::string extension_of(const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return extension;
}

bool is_ply(const std::filesystem::path& path) {
  std::string first_line;
  std::getline(std::ifstream(path, std::ios::binary), first_line);
  return first_line == "ply" || first_line == "ply\r";
}

/// Refuses an STL file of text that lacks its end: assimp takes what there is for the whole, or makes up the rest.
void check_stl_is_whole(const std::filesystem::path& path) {
  constexpr std::uintmax_t kHeader = 84, kTriangle = 50;  // bytes of the binary form
  constexpr std::streamoff kTail = 1024;                  // holds the last line, whatever name the solid has
  std::ifstream file(path, std::ios::binary);
  std::string bytes(kHeader, '\0');
  file.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  if (!bytes.starts_with("solid")) return;
  const std::uintmax_t size = std::filesystem::file_size(path);
  if (size >= kHeader) {  // binary files may begin with "solid", too
    std::uint32_t triangles = 0;
    std::memcpy(&triangles, bytes.data() + kHeader - sizeof triangles, sizeof triangles);
    if (size == kHeader + kTriangle * triangles) return;
  }
  file.clear();
  file.seekg(-std::min<std::streamoff>(kTail, static_cast<std::streamoff>(size)), std::ios::end);
  const std::string tail(std::istreambuf_iterator<char>(file), {});
  if (tail.find("endsolid") == std::string::npos) fail(path, "has no endsolid; is the file cut short?");
}

/// Refuses faces without corners (OFF files cut short) and indices that lead outside, before assimp's own steps abort
/// the program on the former and follow the latter.
void check_faces(const std::filesystem::path& path, const aiScene& scene) {
  for (unsigned m = 0; m < scene.mNumMeshes; ++m) {
    const aiMesh& part = *scene.mMeshes[m];
    for (unsigned i = 0; i < part.mNumFaces; ++i) {
      if (part.mFaces[i].mNumIndices == 0) {
        fail(path, "face " + std::to_string(i) + " has no corners; is the file cut short?");
      }
      for (unsigned k = 0; k < part.mFaces[i].mNumIndices; ++k) {
        if (part.mFaces[i].mIndices[k] >= part.mNumVertices) {
          fail(path, "face " + std::to_string(i) + " names a vertex that is not there; repair the mesh");
        }
      }
    }
  }
}

/// Appends one of assimp's meshes; the scene's node transforms have been applied before.
void append(const std::filesystem::path& path, const aiMesh& part, Mesh* mesh) {
  const std::size_t base = mesh->points.size();
  for (unsigned i = 0; i < part.mNumVertices; ++i) {
    const aiVector3D& v = part.mVertices[i];
    if (!std::isfinite(v.x) || !std::isfinite(v.y) || !std::isfinite(v.z)) {
      fail(path, "vertex " + std::to_string(base + i) + " is not finite; repair the mesh");
    }
    mesh->points.emplace_back(v.x, v.y, v.z);
  }
  for (unsigned i = 0; i < part.mNumFaces; ++i) {
    const aiFace& face = part.mFaces[i];
    if (face.mNumIndices != 3) continue;
    std::array<std::uint32_t, 3> triangle{};
    for (unsigned k = 0; k < 3; ++k) triangle[k] = static_cast<std::uint32_t>(base + face.mIndices[k]);
    mesh->triangles.push_back(triangle);
  }
}

Mesh read_with_assimp(const std::filesystem::path& path) {
  if (extension_of(path) == ".stl") check_stl_is_whole(path);
  Assimp::Importer importer;
  importer.SetPropertyInteger(AI_CONFIG_PP_SBP_REMOVE, aiPrimitiveType_POINT | aiPrimitiveType_LINE);
  const aiScene* scene = importer.ReadFile(path.string(), 0);
  if (scene != nullptr) {
    check_faces(path, *scene);
    scene =
        importer.ApplyPostProcessing(aiProcess_Triangulate | aiProcess_SortByPType | aiProcess_PreTransformVertices);
  }
  if (scene == nullptr) {
    fail(path, "no mesh with triangles can be read from it (" + one_line(importer.GetErrorString()) + ")");
  }
  Mesh mesh;
  for (unsigned i = 0; i < scene->mNumMeshes; ++i) append(path, *scene->mMeshes[i], &mesh);
  return mesh;
}

void turn_scale_and_set_down(const std::filesystem::path& path, UpAxis up, double size_m, Mesh* mesh) {
  if (up == UpAxis::kY) {
    for (Eigen::Vector3f& p : mesh->points) p = Eigen::Vector3f(p.x(), -p.z(), p.y());
  }
  const Eigen::Vector3d low = mesh->lowest().cast<double>(), high = mesh->highest().cast<double>();
  const double extent = (high - low).maxCoeff();
  if (!(extent > 0) || !std::isfinite(extent)) fail(path, "the mesh has no extent; all its points coincide");
  const double scale = size_m / extent;
  const Eigen::Vector3d foot(0.5 * (low.x() + high.x()), 0.5 * (low.y() + high.y()), low.z());
  for (Eigen::Vector3f& p : mesh->points) p = (scale * (p.cast<double>() - foot)).cast<float>();
}

}  // namespace

Eigen::Vector3f Mesh::lowest() const {
  if (points.empty()) return Eigen::Vector3f::Zero();
  Eigen::Vector3f corner = points.front();
  for (const Eigen::Vector3f& p : points) corner = corner.cwiseMin(p);
  return corner;
}

Eigen::Vector3f Mesh::highest() const {
  if (points.empty()) return Eigen::Vector3f::Zero();
  Eigen::Vector3f corner = points.front();
  for (const Eigen::Vector3f& p : points) corner = corner.cwiseMax(p);
  return corner;
}

UpAxis default_up(const std::filesystem::path& path) {
  const std::string extension = extension_of(path);
  return extension == ".glb" || extension == ".gltf" || extension == ".obj" ? UpAxis::kY : UpAxis::kZ;
}

Mesh load_mesh(const std::filesystem::path& path, const MeshOptions& options) {
  if (!(options.size_m >= kSmallestObject_m && options.size_m <= kLargestObject_m)) {
    std::ostringstream fault;
    fault << "can't be scaled to " << options.size_m << " m; give a size between " << kSmallestObject_m << " and "
          << kLargestObject_m << " m";
    fail(path, fault.str());
  }
  check_readable(path);

  Mesh mesh;
  if (is_ply(path)) {
    // Not through assimp, whose reader makes up the faces that a file cut short lacks.
    PlyModel model = read_ply(path);
    mesh = {std::move(model.points), std::move(model.triangles)};
  } else {
    mesh = read_with_assimp(path);
  }
  if (mesh.triangles.empty()) fail(path, "the mesh has no triangles; a point cloud can't be rendered");
  turn_scale_and_set_down(path, options.up.value_or(default_up(path)), options.size_m, &mesh);
  return mesh;
}

}  // namespace vantage::sim
