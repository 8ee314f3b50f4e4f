#include "offboard/mapping/octomap_io.h"

#include <filesystem>
#include <fstream>
#include <random>

#include <gtest/gtest.h>

#include "calib/files/input_error.h"
#include "tests/offboard/mapping/analytic_scene.h"
#include "tests/offboard/mapping/octomap_oracle.h"

namespace vantage {
namespace {

class OctomapIo : public testing::Test {
 protected:
  OctomapIo() {
    folder_ = std::filesystem::temp_directory_path() / ("vantage_octomap_io_" + std::to_string(::getpid()) + "_" +
                                                        testing::UnitTest::GetInstance()->current_test_info()->name());
    std::filesystem::create_directories(folder_);
  }
  ~OctomapIo() override { std::filesystem::remove_all(folder_); }

  static std::string bytes_of(const std::filesystem::path& path) {
    std::ifstream in(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  void write_bytes(const std::filesystem::path& path, const std::string& bytes) {
    std::ofstream(path, std::ios::binary) << bytes;
  }

  std::filesystem::path folder_;
};

OccupancyMap scene_map() {
  OccupancyMap map(Region::cube({0, 0, 0.3}, 0.64, 0.02));
  const AnalyticScene scene;
  for (int i : {0, 5, 18})
    EXPECT_TRUE(map.integrate(scene.depth_map(vga_camera(), ring_views()[static_cast<std::size_t>(i)])).ok);
  return map;
}

TEST_F(OctomapIo, MapToOcTreeAndBackIsTheSameMapButForMarks) {
  OccupancyMap map = scene_map();
  OccupancyMap back = from_octree(*to_octree(map), map.region());
  EXPECT_FALSE(back.has_marks());
  EXPECT_EQ(back.counts().occupied, map.counts().occupied);
  EXPECT_EQ(back.counts().unobserved, map.counts().unobserved);
  EXPECT_EQ(back.entropy_nats(), map.entropy_nats());
  for (int z = 0; z < 32; ++z) {
    for (int y = 0; y < 32; ++y) {
      for (int x = 0; x < 32; ++x) {
        ASSERT_EQ(map.observed({x, y, z}), back.observed({x, y, z}));
        ASSERT_EQ(map.log_odds({x, y, z}), back.log_odds({x, y, z}));
      }
    }
  }
}

TEST_F(OctomapIo, AnyOcTreeComesBackWithEveryLeafToTheBit) {
  const unsigned seed = 3;
  RecordProperty("seed", static_cast<int>(seed));
  std::mt19937 random(seed);
  std::uniform_int_distribution<int> key(32768 - 40, 32768 + 39);
  std::uniform_real_distribution<float> value(-2, 3.5F);
  octomap::OcTree tree(0.05);
  for (int i = 0; i < 3000; ++i) {
    const octomap::OcTreeKey at(static_cast<octomap::key_type>(key(random)),
                                static_cast<octomap::key_type>(key(random)),
                                static_cast<octomap::key_type>(key(random)));
    tree.setNodeValue(at, i % 3 == 0 ? value(random) : 0.85F, true);
  }
  // A block that prunes to a coarse leaf.
  for (int i = 0; i < 512; ++i) {
    tree.setNodeValue(octomap::OcTreeKey(static_cast<octomap::key_type>(32768 + (i & 7)),
                                         static_cast<octomap::key_type>(32768 + (i >> 3 & 7)),
                                         static_cast<octomap::key_type>(32768 + (i >> 6))),
                      -1.25F, true);
  }
  tree.updateInnerOccupancy();
  tree.prune();
  const auto back = to_octree(from_octree(tree));
  EXPECT_EQ(back->getNumLeafNodes(), tree.getNumLeafNodes());
  EXPECT_TRUE(*back == tree);
  ASSERT_TRUE(tree.write((folder_ / "foreign.ot").string()));
  EXPECT_TRUE(*to_octree(read_map(folder_ / "foreign.ot")) == tree);
}

TEST_F(OctomapIo, WrittenMapReadsBackEqualMarksIncluded) {
  const OccupancyMap map = scene_map();
  ASSERT_GT(map.counts().marked, 0);
  write_map(folder_ / "map.ot", map);
  const OccupancyMap back = read_map(folder_ / "map.ot");
  EXPECT_TRUE(back == map);
  EXPECT_TRUE(back.has_marks());
}

TEST_F(OctomapIo, OctoMapsOwnReaderOpensOurFiles) {
  const OccupancyMap map = scene_map();
  write_map(folder_ / "map.ot", map);
  const std::unique_ptr<octomap::AbstractOcTree> tree(octomap::AbstractOcTree::read((folder_ / "map.ot").string()));
  ASSERT_NE(tree, nullptr);
  const auto* octree = dynamic_cast<octomap::OcTree*>(tree.get());
  ASSERT_NE(octree, nullptr);
  EXPECT_TRUE(*octree == *to_octree(map));
}

TEST_F(OctomapIo, BinaryFilesKeepTheOccupiedAndTheFree) {
  const OccupancyMap map = scene_map();
  write_map(folder_ / "map.bt", map);
  octomap::OcTree oracle(0.02);
  ASSERT_TRUE(oracle.readBinary((folder_ / "map.bt").string()));
  const OccupancyMap back = read_map(folder_ / "map.bt", map.region());
  for (int z = 0; z < 32; ++z) {
    for (int y = 0; y < 32; ++y) {
      for (int x = 0; x < 32; ++x) {
        const octomap::OcTreeNode* node = node_at(oracle, map.region(), {x, y, z});
        ASSERT_EQ(back.observed({x, y, z}), node != nullptr);
        ASSERT_EQ(back.observed({x, y, z}), map.observed({x, y, z}));
        if (node == nullptr) continue;
        ASSERT_EQ(back.state({x, y, z}) == VoxelState::kOccupied, oracle.isNodeOccupied(node));
      }
    }
  }
}

TEST_F(OctomapIo, EveryTruncationIsRefusedOrOctoMapsTreeAlone) {
  OccupancyMap map(Region{{0, 0, 0}, {16, 16, 16}, 0.1});
  for (int i = 0; i < 16; ++i)
    ASSERT_TRUE(map.set_log_odds({i, (i * 7) % 16, (i * 3) % 16}, 0.1F * static_cast<float>(i)));
  map.set_occlusion_distance({3, 3, 3}, 0.1);
  write_map(folder_ / "whole.ot", map);
  const std::string whole = bytes_of(folder_ / "whole.ot");
  const std::size_t tree_end = whole.find("\nVANTAGE-MAP");
  ASSERT_NE(tree_end, std::string::npos);
  for (std::size_t size = 0; size < whole.size(); ++size) {
    if (size == tree_end) continue;
    write_bytes(folder_ / "cut.ot", whole.substr(0, size));
    EXPECT_THROW(read_map(folder_ / "cut.ot"), InputError) << size;
  }
  write_bytes(folder_ / "cut.ot", whole.substr(0, tree_end));
  EXPECT_FALSE(read_map(folder_ / "cut.ot").has_marks());
}

TEST_F(OctomapIo, DamageIsRefused) {
  const OccupancyMap map = scene_map();
  write_map(folder_ / "whole.ot", map);
  const std::string whole = bytes_of(folder_ / "whole.ot");
  const std::size_t tree_end = whole.find("\nVANTAGE-MAP");
  const unsigned seed = 5;
  RecordProperty("seed", static_cast<int>(seed));
  std::mt19937 random(seed);
  // In our section every changed byte shows; in OctoMap's tree a changed value is a value: it must not crash.
  for (int trial = 0; trial < 60; ++trial) {
    std::string damaged = whole;
    const bool ours = trial % 2 == 0;
    const std::size_t at = ours ? tree_end + random() % (whole.size() - tree_end) : random() % tree_end;
    damaged[at] = static_cast<char>(damaged[at] ^ static_cast<char>(1 + random() % 255));
    write_bytes(folder_ / "damaged.ot", damaged);
    if (ours) {
      EXPECT_THROW(read_map(folder_ / "damaged.ot"), InputError) << at;
    } else {
      try {
        read_map(folder_ / "damaged.ot");
      } catch (const InputError&) {
      }
    }
  }
}

TEST_F(OctomapIo, ForeignFilesAreRefusedByName) {
  const auto expect_error = [&](const std::string& bytes, const std::string& part) {
    write_bytes(folder_ / "foreign.ot", bytes);
    try {
      read_map(folder_ / "foreign.ot");
      ADD_FAILURE() << "accepted: " << bytes;
    } catch (const InputError& error) {
      EXPECT_NE(std::string(error.what()).find("foreign.ot"), std::string::npos) << error.what();
      EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
    }
  };
  expect_error("", "empty");
  expect_error("ply\nformat ascii 1.0\n", "not an OctoMap");
  expect_error("# Octomap OcTree file\nid ColorOcTree\nsize 0\nres 0.1\ndata\n", "ColorOcTree");
  expect_error("# Octomap OcTree file\nid OcTree\nsize 0\nres nan\ndata\n", "res");
  expect_error("# Octomap OcTree file\nid OcTree\nsize 0\nres -1\ndata\n", "res");
  expect_error("# Octomap OcTree file\nid OcTree\nres 0.1\ndata\n", "size");
  expect_error("# Octomap OcTree file\nid OcTree\nsize 3\nres 0.1\ndata\n", "cut short");
  // A chain of inner nodes with no end.
  std::string chain = "# Octomap OcTree file\nid OcTree\nsize 4000000\nres 0.1\ndata\n";
  for (int i = 0; i < 100; ++i) chain += std::string("\0\0\0\0\1", 5);
  expect_error(chain, "deepest");
  EXPECT_THROW(read_map(folder_ / "missing.ot"), InputError);
}

TEST_F(OctomapIo, RegionsThatDoNotFitAreRefused) {
  const OccupancyMap map = scene_map();
  const auto tree = to_octree(map);
  EXPECT_THROW(from_octree(*tree, Region::cube({0, 0, 0}, 1, 0.01)), InputError);
  EXPECT_THROW(from_octree(*tree, Region{{0.003, 0, 0}, {8, 8, 8}, 0.02}), InputError);
  write_map(folder_ / "map.ot", map);
  EXPECT_THROW(read_map(folder_ / "map.ot", Region::cube({0, 0, 0}, 0.64, 0.02)), InputError);
  EXPECT_THROW(write_map(folder_ / "map.txt", map), InputError);
  EXPECT_THROW(write_map(folder_ / "off.ot", OccupancyMap(Region{{0.003, 0, 0}, {8, 8, 8}, 0.02})), InputError);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "off.ot"));
}

}  // namespace
}  // namespace vantage
