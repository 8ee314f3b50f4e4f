#include "drivers/sim/mesh.h"

#include <cstdint>
#include <filesystem>
#include <limits>
#include <sstream>
#include <string>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "calib/files/input_error.h"
#include "scratch_folder.h"

namespace vantage::sim {
namespace {

/// A tetrahedron with its sides along the axes, 2 along x, 1 along y, 4 along z, from (10, 20, 30) on.
const char* const kWedgeObj = "v 10 20 30\nv 12 20 30\nv 10 21 30\nv 10 20 34\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";

const std::string kWedgePly =
    "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    "element face 4\nproperty list uchar int vertex_indices\nend_header\n"
    "10 20 30\n12 20 30\n10 21 30\n10 20 34\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n";

const std::string kWedgeOff =
    "OFF\n4 4 0\n10 20 30\n12 20 30\n10 21 30\n10 20 34\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n";

/// The same in STL's form of text or bytes; its normals are not read.
std::string wedge_stl(bool binary) {
  const float points[4][3] = {{10, 20, 30}, {12, 20, 30}, {10, 21, 30}, {10, 20, 34}};
  const int faces[4][3] = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  std::ostringstream text;
  text << "solid wedge\n";
  std::string bytes = std::string(80, ' ') + std::string("\4\0\0\0", 4);
  for (const auto& face : faces) {
    text << "facet normal 0 0 1\nouter loop\n";
    bytes += std::string(12, '\0');
    for (const int corner : face) {
      text << "vertex " << points[corner][0] << ' ' << points[corner][1] << ' ' << points[corner][2] << '\n';
      bytes.append(reinterpret_cast<const char*>(points[corner]), sizeof points[corner]);
    }
    text << "endloop\nendfacet\n";
    bytes += std::string(2, '\0');
  }
  return binary ? bytes : text.str() + "endsolid wedge\n";
}

/// The triangle (0, 0, 0), (1, 0, 0), (0, 2, 0) under a node that moves it by (0, 5, 0), in glTF's binary form.
std::string triangle_glb() {
  const float corners[9] = {0, 0, 0, 1, 0, 0, 0, 2, 0};
  std::string json =
      R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0,"translation":[0,5,0]}],)"
      R"("meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],"buffers":[{"byteLength":36}],)"
      R"("bufferViews":[{"buffer":0,"byteLength":36}],)"
      R"("accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,2,0]}]})";
  json.resize((json.size() + 3) / 4 * 4, ' ');
  const auto word = [](std::size_t value) {
    const auto number = static_cast<std::uint32_t>(value);
    return std::string(reinterpret_cast<const char*>(&number), 4);
  };
  return "glTF" + word(2) + word(12 + 8 + json.size() + 8 + 36) + word(json.size()) + "JSON" + json + word(36) +
         std::string("BIN\0", 4) + std::string(reinterpret_cast<const char*>(corners), 36);
}

void expect_box(const Mesh& mesh, const Eigen::Vector3f& low, const Eigen::Vector3f& high) {
  EXPECT_LT((mesh.lowest() - low).norm(), 1e-6F) << mesh.lowest().transpose();
  EXPECT_LT((mesh.highest() - high).norm(), 1e-6F) << mesh.highest().transpose();
}

TEST(Mesh, PlyIsTakenZUpScaledAndSetOnTheGround) {
  const ScratchFolder folder;
  const Mesh mesh = load_mesh(folder.write("wedge.ply", kWedgePly), {.size_m = 0.4, .up = {}});
  expect_box(mesh, {-0.1F, -0.05F, 0}, {0.1F, 0.05F, 0.4F});
  EXPECT_EQ(mesh.triangles.size(), 4U);
}

TEST(Mesh, StlAndOffAreTakenZUp) {
  const ScratchFolder folder;
  for (const std::filesystem::path& path :
       {folder.write("text.stl", wedge_stl(false)), folder.write("bytes.stl", wedge_stl(true)),
        folder.write("wedge.off", kWedgeOff)}) {
    SCOPED_TRACE(path);
    const Mesh mesh = load_mesh(path, {.size_m = 0.4, .up = {}});
    expect_box(mesh, {-0.1F, -0.05F, 0}, {0.1F, 0.05F, 0.4F});
    EXPECT_EQ(mesh.triangles.size(), 4U);
  }
}

TEST(Mesh, ObjIsTakenYUp) {
  const ScratchFolder folder;
  // The file's y becomes the height, its z goes backwards along y.
  expect_box(load_mesh(folder.write("wedge.obj", kWedgeObj), {.size_m = 0.4, .up = {}}), {-0.1F, -0.2F, 0},
             {0.1F, 0.2F, 0.1F});
}

TEST(Mesh, TurningYUpKeepsHandedness) {
  const ScratchFolder folder;
  const Mesh mesh = load_mesh(folder.write("wedge.obj", kWedgeObj), {.size_m = 0.4, .up = UpAxis::kY});
  // Signed volume: 2 * 1 * 4 / 6 of the file's units, times 0.1^3; a mirrored mesh has it negative.
  double volume = 0;
  for (const auto& [a, b, c] : mesh.triangles) {
    volume += static_cast<double>(mesh.points[a].dot(mesh.points[b].cross(mesh.points[c]))) / 6;
  }
  EXPECT_NEAR(volume, 8.0 / 6 * 1e-3, 1e-8);
}

TEST(Mesh, TheUpOptionOverrulesTheFormat) {
  const ScratchFolder folder;
  expect_box(load_mesh(folder.write("wedge.obj", kWedgeObj), {.size_m = 0.4, .up = UpAxis::kZ}), {-0.1F, -0.05F, 0},
             {0.1F, 0.05F, 0.4F});
  expect_box(load_mesh(folder.write("wedge.ply", kWedgePly), {.size_m = 0.4, .up = UpAxis::kY}), {-0.1F, -0.2F, 0},
             {0.1F, 0.2F, 0.1F});
}

TEST(Mesh, GlbIsTakenYUpWithItsNodesTransforms) {
  const ScratchFolder folder;
  expect_box(load_mesh(folder.write("triangle.glb", triangle_glb()), {.size_m = 0.2, .up = {}}), {-0.05F, 0, 0},
             {0.05F, 0, 0.2F});
}

TEST(Mesh, PolygonsBecomeTriangles) {
  const ScratchFolder folder;
  EXPECT_EQ(load_mesh(folder.write("cube.obj", kCubeObj)).triangles.size(), 12U);
}

void expect_refused(const std::filesystem::path& path, const MeshOptions& options = {}) {
  SCOPED_TRACE(path);
  try {
    load_mesh(path, options);
    FAIL() << "taken";
  } catch (const InputError& error) {
    EXPECT_EQ(std::string(error.what()).rfind(path.string() + ": ", 0), 0U) << error.what();
    EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos) << error.what();
  }
}

TEST(Mesh, RefusesWhatIsNoMeshAndNamesTheFile) {
  const ScratchFolder folder;
  expect_refused(folder / "missing.ply");
  std::filesystem::create_directory(folder / "folder.ply");
  expect_refused(folder / "folder.ply");
  for (const char* extension : {".ply", ".obj", ".glb", ".stl", ".off", ".txt", ""}) {
    expect_refused(folder.write(std::string("empty") + extension, ""));
    expect_refused(folder.write(std::string("text") + extension, "this is\nno mesh\n"));
  }
  for (const std::size_t missing : {3U, 8U, 20U, 40U, 70U}) {
    expect_refused(folder.write("cut.ply", kWedgePly.substr(0, kWedgePly.size() - missing)));
  }
  for (const std::size_t missing : {8U, 16U, 24U, 40U, 60U}) {
    expect_refused(folder.write("cut.off", kWedgeOff.substr(0, kWedgeOff.size() - missing)));
  }
  for (const std::size_t missing : {20U, 100U, 200U}) {
    expect_refused(folder.write("cut.stl", wedge_stl(false).substr(0, wedge_stl(false).size() - missing)));
    expect_refused(folder.write("cut_bytes.stl", wedge_stl(true).substr(0, wedge_stl(true).size() - missing)));
  }
  expect_refused(folder.write("cut.glb", triangle_glb().substr(0, 100)));
}

TEST(Mesh, RefusesPointCloudsAndBadVertices) {
  const ScratchFolder folder;
  expect_refused(folder.write("cloud.ply",
                              "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
                              "property float z\nend_header\n0 0 0\n1 0 0\n0 1 0\n"));
  expect_refused(folder.write("lines.obj", "v 0 0 0\nv 1 0 0\nl 1 2\n"));
  expect_refused(folder.write("nan.obj", "v 0 0 0\nv 1 0 0\nv 0 nan 0\nf 1 2 3\n"));
  expect_refused(folder.write("inf.obj", "v 0 0 0\nv 1 0 0\nv 0 inf 0\nf 1 2 3\n"));
  std::string nan_ply = kWedgePly;
  nan_ply.replace(nan_ply.find("12 20 30"), 2, "nan");
  expect_refused(folder.write("nan.ply", nan_ply));
  expect_refused(folder.write("point.obj", "v 1 2 3\nv 1 2 3\nv 1 2 3\nf 1 2 3\n"));
  expect_refused(folder.write("index.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n"));
}

TEST(Mesh, RefusesSizesThatDoNotFitTheRoom) {
  const ScratchFolder folder;
  const auto path = folder.write("cube.obj", kCubeObj);
  for (const double size_m :
       {0.0, -1.0, 0.001, 50.0, std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    expect_refused(path, {.size_m = size_m, .up = {}});
  }
}

}  // namespace
}  // namespace vantage::sim
