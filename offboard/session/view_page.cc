#include "offboard/session/view_page.h"

#include <cmath>
#include <cstdint>
#include <string_view>

#include <fmt/format.h>
#include <sodium.h>

#include "calib/files/atomic_file.h"
#include "offboard/session/view_page_template.h"

namespace vantage {
namespace {

std::string base64(const std::vector<std::uint8_t>& bytes) {
  std::string text(sodium_base64_ENCODED_LEN(bytes.size(), sodium_base64_VARIANT_ORIGINAL), '\0');
  sodium_bin2base64(text.data(), text.size(), bytes.data(), bytes.size(), sodium_base64_VARIANT_ORIGINAL);
  text.pop_back();  // its NUL
  return text;
}

/// The smallest cube that holds the points: position and edge.
Eigen::Vector4f cube_of(const std::vector<Eigen::Vector3f>& points) {
  if (points.empty()) return {0, 0, 0, 1};
  Eigen::Vector3f low = points.front(), high = points.front();
  for (const Eigen::Vector3f& point : points) {
    low = low.cwiseMin(point);
    high = high.cwiseMax(point);
  }
  return {low.x(), low.y(), low.z(), std::max((high - low).maxCoeff(), 1e-3F)};
}

/// 12 bytes a point: 16-bit positions over the cube and two bytes of padding, 8-bit normals and one of padding.
std::vector<std::uint8_t> pack(const PlyModel& cloud, const Eigen::Vector4f& cube) {
  std::vector<std::uint8_t> bytes;
  bytes.reserve(12 * cloud.points.size());
  for (std::size_t i = 0; i < cloud.points.size(); ++i) {
    const Eigen::Vector3f place = (cloud.points[i] - cube.head<3>()) / cube.w() * 65535;
    for (int axis = 0; axis < 3; ++axis) {
      const auto value = static_cast<std::uint16_t>(std::lround(place[axis]));
      bytes.push_back(static_cast<std::uint8_t>(value));
      bytes.push_back(static_cast<std::uint8_t>(value >> 8));
    }
    bytes.insert(bytes.end(), 2, 0);
    for (int axis = 0; axis < 3; ++axis) {
      bytes.push_back(static_cast<std::uint8_t>(std::lround(127 * cloud.normals[i][axis])));
    }
    bytes.push_back(0);
  }
  return bytes;
}

std::string numbers(const std::vector<Eigen::Isometry3d>& cameras) {
  std::string text = "[";
  for (const Eigen::Isometry3d& camera : cameras) {
    text += text.size() > 1 ? ",[" : "[";
    for (int i = 0; i < 12; ++i) text += fmt::format("{}{:.5f}", i == 0 ? "" : ",", camera.matrix()(i / 4, i % 4));
    text += "]";
  }
  return text + "]";
}

}  // namespace

void write_view_page(const std::filesystem::path& path, const PlyModel& cloud,
                     const std::vector<Eigen::Isometry3d>& cameras, const std::string& summary) {
  const Eigen::Vector4f cube = cube_of(cloud.points);
  AtomicFile file(path);
  std::string_view rest = kViewPageTemplate;
  const auto put = [&](std::string_view mark, const std::string& value) {
    const std::size_t at = rest.find(mark);
    file.stream() << rest.substr(0, at) << value;
    rest.remove_prefix(at + mark.size());
  };
  // In the template's order.
  put("@SUMMARY@", summary);
  put("@SUMMARY@", summary);
  put("@BOX@", fmt::format("[{},{},{},{}]", cube.x(), cube.y(), cube.z(), cube.w()));
  put("@CAMERAS@", numbers(cameras));
  put("@POINTS@", base64(pack(cloud, cube)));
  file.stream() << rest;
  file.commit();
}

}  // namespace vantage
