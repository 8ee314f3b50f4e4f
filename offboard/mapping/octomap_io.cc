#include "offboard/mapping/octomap_io.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <sstream>
#include <stdexcept>
#include <vector>

#include <octomap/OcTree.h>

#include "calib/files/atomic_file.h"
#include "calib/files/input_error.h"
#include "offboard/mapping/octomap_file.h"

namespace vantage {
namespace {

constexpr int kOriginKey = 32768;
constexpr char kSection[] = "\nVANTAGE-MAP 1\n";  // opens our section, behind the tree
constexpr std::uint64_t kMaxSectionBytes = std::uint64_t{4} << 30;

[[noreturn]] void fail(const std::string& name, const std::string& fault) { throw InputError(name + ": " + fault); }

/// OctoMap key of the region's first voxel.
Eigen::Vector3i first_key(const Region& region) {
  return (region.min_corner / region.resolution_m).array().round().cast<int>() + kOriginKey;
}

bool keys_fit(const Region& region) {
  if ((region.min_corner.array().abs() / region.resolution_m > 40000).any()) return false;
  const Eigen::Array3i first = first_key(region);
  return (first >= 0).all() && (first + region.size_voxels.array() <= 2 * kOriginKey).all();
}

Region bounding_region(const std::string& name, const OctomapFile& file) {
  Eigen::Array3i low = Eigen::Array3i::Constant(kOriginKey), high = low + 1;
  bool first = true;
  for (const OctomapLeaf& leaf : file.leaves) {
    const Eigen::Array3i corner(leaf.corner[0], leaf.corner[1], leaf.corner[2]);
    if (first) {
      low = corner;
      high = corner + leaf.edge;
    }
    first = false;
    low = low.min(corner).eval();
    high = high.max(corner + leaf.edge).eval();
  }
  Region region;
  region.resolution_m = file.resolution_m;
  region.min_corner = (low - kOriginKey).cast<double>() * file.resolution_m;
  region.size_voxels = high - low;
  std::string why;
  if (!region.valid(&why)) fail(name, why + "; give a region");
  return region;
}

OccupancyMap map_of_leaves(const std::string& name, const OctomapFile& file, const std::optional<Region>& wanted,
                           const SensorModel& model) {
  const Region region = wanted ? *wanted : bounding_region(name, file);
  std::string why;
  if (!region.valid(&why)) fail(name, why);
  if (std::abs(region.resolution_m - file.resolution_m) > 1e-9 * file.resolution_m) {
    fail(name, "has a resolution of " + std::to_string(file.resolution_m) + " m, the region one of " +
                   std::to_string(region.resolution_m) + " m");
  }
  if (!region.aligned() || !keys_fit(region)) {
    fail(name, "the region's corner must be a multiple of the resolution, within OctoMap's 65536 voxels");
  }
  OccupancyMap map(region, model);
  map.next_revision();
  const Eigen::Array3i origin = first_key(region);
  std::vector<std::uint8_t> opened(map.brick_count(), 0);
  for (const OctomapLeaf& leaf : file.leaves) {
    Level level = kUnobservedLevel;
    if (!map.levels().find_or_add(leaf.log_odds, &level)) {
      fail(name, "has more than " + std::to_string(LogOddsLevels::kMaxLevels) + " distinct values");
    }
    const Eigen::Array3i corner = Eigen::Array3i(leaf.corner[0], leaf.corner[1], leaf.corner[2]) - origin;
    const Eigen::Array3i low = corner.max(0), high = (corner + leaf.edge).min(region.size_voxels.array());
    Eigen::Vector3i voxel;
    for (voxel.z() = low.z(); voxel.z() < high.z(); ++voxel.z()) {
      for (voxel.y() = low.y(); voxel.y() < high.y(); ++voxel.y()) {
        for (voxel.x() = low.x(); voxel.x() < high.x(); ++voxel.x()) {
          const std::size_t brick = map.brick_index(voxel / OccupancyMap::kBrickEdge);
          map.open(brick).level[OccupancyMap::index_in_brick(voxel)] = level;
          opened[brick] = 1;
        }
      }
    }
  }
  for (std::size_t brick = 0; brick < opened.size(); ++brick) {
    if (opened[brick] != 0) map.close(brick, true);
  }
  return map;
}

template <typename T>
void put(std::string* out, const T& value) {
  out->append(reinterpret_cast<const char*>(&value), sizeof value);
}

template <typename T>
bool take(std::string_view* in, T* value) {
  if (in->size() < sizeof *value) return false;
  std::memcpy(value, in->data(), sizeof *value);
  in->remove_prefix(sizeof *value);
  return true;
}

/// Fowler-Noll-Vo 1a, 64 bits.
std::uint64_t checksum(std::string_view bytes) {
  std::uint64_t sum = 0xcbf29ce484222325;
  for (const char byte : bytes) sum = (sum ^ static_cast<unsigned char>(byte)) * 0x100000001b3;
  return sum;
}

/// Our section: region, sensor model, marks (docs/mapping.md gives the layout).
std::string section_of(const OccupancyMap& map) {
  std::string out;
  const Region& region = map.region();
  const SensorModel& model = map.sensor_model();
  for (int i = 0; i < 3; ++i) put(&out, region.min_corner[i]);
  for (int i = 0; i < 3; ++i) put(&out, std::int32_t{region.size_voxels[i]});
  put(&out, region.resolution_m);
  for (const double value : {model.hit_probability, model.miss_probability, model.clamp_min, model.clamp_max,
                             model.max_range_m, model.occlusion_range_m, model.free_margin_sigmas}) {
    put(&out, value);
  }
  put(&out, static_cast<std::uint8_t>(map.has_marks()));
  for (std::size_t b = 0; b < map.brick_count(); ++b) {
    const OccupancyMap::Brick* brick = map.dense(b);
    if (brick == nullptr ||
        std::all_of(brick->mark.begin(), brick->mark.end(), [](std::uint8_t mark) { return mark == 0; })) {
      continue;
    }
    put(&out, static_cast<std::uint32_t>(b));
    put(&out, brick->mark);
  }
  return out;
}

struct Section {
  Region region;
  SensorModel model;
  bool has_marks = false;
  std::vector<std::pair<std::uint32_t, std::array<std::uint8_t, OccupancyMap::kBrickVoxels>>> marks;
};

/// The section behind the tree, if the file is ours.
std::optional<Section> read_section(std::istream& in, const std::string& name) {
  std::string rest(sizeof kSection - 1, '\0');
  in.read(rest.data(), static_cast<std::streamsize>(rest.size()));
  if (in.gcount() == 0) return std::nullopt;
  std::uint64_t size = 0, expected = 0;
  if (!in || rest != kSection) fail(name, "something else follows the OctoMap, or our section is cut short");
  if (!in.read(reinterpret_cast<char*>(&size), sizeof size) || size > kMaxSectionBytes) {
    fail(name, "our section is cut short");
  }
  std::string bytes;
  while (bytes.size() < size) {  // the size may lie: memory grows with what is really read
    const std::size_t before = bytes.size(), more = std::min<std::size_t>(size - before, 1 << 20);
    bytes.resize(before + more);
    if (!in.read(&bytes[before], static_cast<std::streamsize>(more))) fail(name, "our section is cut short");
  }
  if (!in.read(reinterpret_cast<char*>(&expected), sizeof expected)) fail(name, "our section is cut short");
  if (checksum(bytes) != expected) fail(name, "our section is damaged (its checksum differs)");
  Section section;
  std::string_view view = bytes;
  bool good = true;
  for (int i = 0; i < 3; ++i) good = good && take(&view, &section.region.min_corner[i]);
  for (int i = 0; i < 3; ++i) good = good && take(&view, &section.region.size_voxels[i]);
  good = good && take(&view, &section.region.resolution_m);
  SensorModel& model = section.model;
  for (double* value : {&model.hit_probability, &model.miss_probability, &model.clamp_min, &model.clamp_max,
                        &model.max_range_m, &model.occlusion_range_m, &model.free_margin_sigmas}) {
    good = good && take(&view, value);
  }
  std::uint8_t has_marks = 0;
  good = good && take(&view, &has_marks);
  section.has_marks = has_marks != 0;
  while (good && !view.empty()) {
    auto& [brick, marks] = section.marks.emplace_back();
    good = take(&view, &brick) && take(&view, &marks);
  }
  std::string why;
  if (!good || !section.region.valid(&why) || !section.model.valid(&why)) {
    fail(name, "our section is damaged" + (why.empty() ? why : ": " + why));
  }
  return section;
}

}  // namespace

std::unique_ptr<octomap::OcTree> to_octree(const OccupancyMap& map) {
  const Region& region = map.region();
  if (!region.aligned() || !keys_fit(region)) {
    throw std::invalid_argument("the region's corner must be a multiple of the resolution to become an OctoMap");
  }
  auto tree = std::make_unique<octomap::OcTree>(region.resolution_m);
  // setNodeValue clamps: open the clamps while values are copied.
  tree->setClampingThresMin(0);
  tree->setClampingThresMax(1);
  const Eigen::Vector3i origin = first_key(region);
  for (std::size_t b = 0; b < map.brick_count(); ++b) {
    const OccupancyMap::Brick* brick = map.dense(b);
    if (brick == nullptr && map.uniform_level(b) == kUnobservedLevel) continue;
    const Eigen::Vector3i position = map.brick_position(b), extent = map.brick_extent(position);
    for (int z = 0; z < extent.z(); ++z) {
      for (int y = 0; y < extent.y(); ++y) {
        for (int x = 0; x < extent.x(); ++x) {
          const Level level =
              brick == nullptr ? map.uniform_level(b) : brick->level[static_cast<std::size_t>(x | y << 3 | z << 6)];
          if (level == kUnobservedLevel) continue;
          const Eigen::Vector3i key = origin + OccupancyMap::kBrickEdge * position + Eigen::Vector3i(x, y, z);
          tree->setNodeValue(
              octomap::OcTreeKey(static_cast<octomap::key_type>(key.x()), static_cast<octomap::key_type>(key.y()),
                                 static_cast<octomap::key_type>(key.z())),
              map.levels().log_odds(level), true);
        }
      }
    }
  }
  tree->updateInnerOccupancy();
  tree->prune();
  const SensorModel& model = map.sensor_model();
  tree->setProbHit(model.hit_probability);
  tree->setProbMiss(model.miss_probability);
  tree->setClampingThresMin(model.clamp_min);
  tree->setClampingThresMax(model.clamp_max);
  return tree;
}

OccupancyMap from_octree(const octomap::OcTree& tree, const std::optional<Region>& region, const SensorModel& model) {
  OctomapFile file;
  file.resolution_m = tree.getResolution();
  for (auto leaf = tree.begin_leafs(), end = tree.end_leafs(); leaf != end; ++leaf) {
    const int edge = 1 << (tree.getTreeDepth() - leaf.getDepth());
    if (!std::isfinite(leaf->getLogOdds())) fail("OcTree", "a node's value is not finite");
    // The index key of a coarse leaf has its low bits cleared: it is the leaf's corner.
    const octomap::OcTreeKey key = leaf.getIndexKey();
    file.leaves.push_back({{key[0], key[1], key[2]}, edge, leaf->getLogOdds()});
  }
  return map_of_leaves("OcTree", file, region, model);
}

void write_map(const std::filesystem::path& path, const OccupancyMap& map) {
  const bool full = path.extension() == ".ot";
  if (!full && path.extension() != ".bt") fail(path.string(), "a map's file must end in .ot or .bt");
  if (!map.region().aligned() || !keys_fit(map.region())) {
    fail(path.string(), "the region's corner must be a multiple of the resolution to become an OctoMap");
  }
  const std::unique_ptr<octomap::OcTree> tree = to_octree(map);
  AtomicFile file(path);
  if (full) {
    tree->write(file.stream());
    const std::string section = section_of(map);
    const std::uint64_t size = section.size(), sum = checksum(section);
    file.stream().write(kSection, sizeof kSection - 1);
    file.stream().write(reinterpret_cast<const char*>(&size), sizeof size);
    file.stream().write(section.data(), static_cast<std::streamsize>(size));
    file.stream().write(reinterpret_cast<const char*>(&sum), sizeof sum);
  } else {
    tree->toMaxLikelihood();
    tree->prune();
    tree->writeBinaryConst(file.stream());
  }
  file.commit();
}

OccupancyMap read_map(const std::filesystem::path& path, const std::optional<Region>& region,
                      const SensorModel& model) {
  const std::string name = path.string();
  std::ifstream in(path, std::ios::binary);
  if (!in) fail(name, "no such file, or it can't be read");
  std::string why;
  if (!model.valid(&why)) throw std::invalid_argument("sensor model: " + why);
  const auto log_odds = [](double p) { return static_cast<float>(std::log(p / (1 - p))); };
  const OctomapFile file = read_octomap(in, name, log_odds(model.clamp_min), log_odds(model.clamp_max));
  const std::optional<Section> section = read_section(in, name);
  if (!section) return map_of_leaves(name, file, region, model);
  if (region && !(*region == section->region)) fail(name, "was written with another region than the one asked for");
  OccupancyMap map = map_of_leaves(name, file, section->region, section->model);
  for (const auto& [brick, marks] : section->marks) {
    if (brick >= map.brick_count()) fail(name, "our section is damaged: a brick outside the region");
    map.open(brick).mark = marks;
    map.close(brick, true);
  }
  map.set_has_marks(section->has_marks);
  return map;
}

}  // namespace vantage
