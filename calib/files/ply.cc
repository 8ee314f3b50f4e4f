#include "calib/files/ply.h"

#include <bit>
#include <cstring>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string>

#include "calib/files/atomic_file.h"
#include "calib/files/input_error.h"

namespace vantage {
namespace {

static_assert(std::endian::native == std::endian::little, "PLY is read and written little-endian");

struct Property {
  std::string type, name;
  std::string list_count_type;  // empty: a scalar
};

struct Element {
  std::string name;
  std::size_t count = 0;
  std::vector<Property> properties;
};

struct Header {
  bool ascii = false;
  std::vector<Element> elements;
};

[[noreturn]] void fail(const std::filesystem::path& path, const std::string& fault) {
  throw InputError(path.string() + ": " + fault);
}

std::size_t type_size(const std::string& type) {
  if (type == "char" || type == "uchar" || type == "int8" || type == "uint8") return 1;
  if (type == "short" || type == "ushort" || type == "int16" || type == "uint16") return 2;
  if (type == "int" || type == "uint" || type == "int32" || type == "uint32" || type == "float" || type == "float32") {
    return 4;
  }
  if (type == "double" || type == "float64") return 8;
  return 0;
}

template <typename T>
double raw_value(const char* bytes) {
  T value;
  std::memcpy(&value, bytes, sizeof value);
  return static_cast<double>(value);
}

double decode(const std::string& type, const char* bytes) {
  if (type == "char" || type == "int8") return raw_value<std::int8_t>(bytes);
  if (type == "uchar" || type == "uint8") return raw_value<std::uint8_t>(bytes);
  if (type == "short" || type == "int16") return raw_value<std::int16_t>(bytes);
  if (type == "ushort" || type == "uint16") return raw_value<std::uint16_t>(bytes);
  if (type == "int" || type == "int32") return raw_value<std::int32_t>(bytes);
  if (type == "uint" || type == "uint32") return raw_value<std::uint32_t>(bytes);
  if (type == "float" || type == "float32") return raw_value<float>(bytes);
  return raw_value<double>(bytes);
}

Header read_header(const std::filesystem::path& path, std::istream& in) {
  std::string line;
  const auto next_line = [&] {
    if (!std::getline(in, line)) fail(path, "the PLY header ends before end_header");
    if (!line.empty() && line.back() == '\r') line.pop_back();
  };
  next_line();
  if (line != "ply") fail(path, "not a PLY file (its first line is not \"ply\")");
  Header header;
  for (next_line(); line != "end_header"; next_line()) {
    std::istringstream words(line);
    std::string word;
    words >> word;
    if (word == "format") {
      words >> word;
      if (word != "ascii" && word != "binary_little_endian") fail(path, "PLY format " + word + " is not supported");
      header.ascii = word == "ascii";
    } else if (word == "element") {
      Element element;
      if (!(words >> element.name >> element.count)) fail(path, "bad PLY header line \"" + line + "\"");
      header.elements.push_back(element);
    } else if (word == "property") {
      Property property;
      words >> property.type;
      if (property.type == "list") words >> property.list_count_type >> property.type;
      words >> property.name;
      if (!words || header.elements.empty() || type_size(property.type) == 0 ||
          (!property.list_count_type.empty() && type_size(property.list_count_type) == 0)) {
        fail(path, "bad PLY header line \"" + line + "\"");
      }
      header.elements.back().properties.push_back(property);
    }
  }
  return header;
}

/// Reads single values, whatever the file's format.
class Values {
 public:
  Values(const std::filesystem::path& path, std::istream& in, bool ascii) : path_(path), in_(in), ascii_(ascii) {}

  double next(const std::string& type) {
    double value = 0;
    if (ascii_) {
      in_ >> value;
    } else {
      std::array<char, 8> bytes{};
      in_.read(bytes.data(), static_cast<std::streamsize>(type_size(type)));
      value = decode(type, bytes.data());
    }
    if (!in_) fail(path_, "the PLY file is cut short");
    return value;
  }

 private:
  const std::filesystem::path& path_;
  std::istream& in_;
  bool ascii_;
};

void read_vertex(const Element& element, Values& values, Eigen::Vector3f* point, Eigen::Vector3f* normal) {
  for (const Property& property : element.properties) {
    if (!property.list_count_type.empty()) {
      const double count = values.next(property.list_count_type);
      for (double i = 0; i < count; ++i) values.next(property.type);
      continue;
    }
    const auto value = static_cast<float>(values.next(property.type));
    if (property.name.size() == 1 && property.name[0] >= 'x' && property.name[0] <= 'z') {
      (*point)[property.name[0] - 'x'] = value;
    } else if (property.name.size() == 2 && property.name[0] == 'n' && property.name[1] >= 'x' &&
               property.name[1] <= 'z') {
      (*normal)[property.name[1] - 'x'] = value;
    }
  }
}

bool has(const Element& element, const std::string& name) {
  for (const Property& property : element.properties) {
    if (property.name == name) return true;
  }
  return false;
}

}  // namespace

void write_ply(const std::filesystem::path& path, const PlyModel& model) {
  const bool normals = !model.normals.empty();
  if (normals && model.normals.size() != model.points.size()) {
    throw std::invalid_argument("write_ply: as many normals as points are needed, or none");
  }
  AtomicFile file(path);
  std::ostream& out = file.stream();
  out << "ply\nformat binary_little_endian 1.0\ncomment Vantage: world frame, metres\n"
      << "element vertex " << model.points.size() << "\nproperty float x\nproperty float y\nproperty float z\n";
  if (normals) out << "property float nx\nproperty float ny\nproperty float nz\n";
  if (!model.triangles.empty()) {
    out << "element face " << model.triangles.size() << "\nproperty list uchar uint vertex_indices\n";
  }
  out << "end_header\n";
  for (std::size_t i = 0; i < model.points.size(); ++i) {
    out.write(reinterpret_cast<const char*>(model.points[i].data()), 3 * sizeof(float));
    if (normals) out.write(reinterpret_cast<const char*>(model.normals[i].data()), 3 * sizeof(float));
  }
  for (const auto& triangle : model.triangles) {
    out.put(3);
    out.write(reinterpret_cast<const char*>(triangle.data()), sizeof triangle);
  }
  file.commit();
}

PlyModel read_ply(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  if (!in) fail(path, "no such file, or it can't be read");
  const Header header = read_header(path, in);
  Values values(path, in, header.ascii);
  PlyModel model;
  for (const Element& element : header.elements) {
    const bool vertices = element.name == "vertex", faces = element.name == "face";
    if (vertices && !(has(element, "x") && has(element, "y") && has(element, "z"))) {
      fail(path, "the PLY file's vertices lack x, y or z");
    }
    const bool with_normals = vertices && has(element, "nx") && has(element, "ny") && has(element, "nz");
    // A header may lie about its counts: memory grows with what is really read.
    for (std::size_t i = 0; i < element.count; ++i) {
      if (vertices) {
        Eigen::Vector3f point = Eigen::Vector3f::Zero(), normal = Eigen::Vector3f::Zero();
        read_vertex(element, values, &point, &normal);
        if (!point.allFinite()) fail(path, "vertex " + std::to_string(i) + " is not finite");
        model.points.push_back(point);
        if (with_normals) model.normals.push_back(normal);
        continue;
      }
      for (const Property& property : element.properties) {
        const bool list = !property.list_count_type.empty();
        const auto count = list ? static_cast<std::size_t>(values.next(property.list_count_type)) : std::size_t{1};
        const bool indices = faces && list;
        if (indices && count != 3) fail(path, "face " + std::to_string(i) + " is not a triangle");
        std::array<std::uint32_t, 3> triangle{};
        for (std::size_t k = 0; k < count; ++k) {
          const double value = values.next(property.type);
          if (!indices) continue;
          if (!(value >= 0 && value < static_cast<double>(model.points.size()))) {
            fail(path, "face " + std::to_string(i) + " names a vertex that is not there");
          }
          triangle[k] = static_cast<std::uint32_t>(value);
        }
        if (indices) model.triangles.push_back(triangle);
      }
    }
  }
  return model;
}

}  // namespace vantage
