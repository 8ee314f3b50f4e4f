#include "offboard/mapping/octomap_file.h"

#include <bit>
#include <cmath>
#include <sstream>

#include "calib/files/input_error.h"

namespace vantage {
namespace {

static_assert(std::endian::native == std::endian::little, "OctoMap files are read little-endian");

constexpr int kTreeDepth = 16;
constexpr std::uint64_t kMaxNodes = std::uint64_t{1} << 32;

class Reader {
 public:
  Reader(std::istream& in, const std::string& name, float free, float occupied)
      : in_(in), name_(name), free_(free), occupied_(occupied) {}

  OctomapFile read() {
    const bool binary = read_header();
    if (nodes_ != 0) {
      if (binary) {
        read_binary_node({0, 0, 0}, 0);
      } else {
        read_node({0, 0, 0}, 0);
      }
    }
    // Pruned leaves of a binary file are nodes as well; both formats count the root.
    if (seen_ != nodes_) {
      fail("damaged: the header says " + std::to_string(nodes_) + " nodes, the file has " + std::to_string(seen_));
    }
    return std::move(file_);
  }

 private:
  using Key = std::array<int, 3>;

  [[noreturn]] void fail(const std::string& fault) const { throw InputError(name_ + ": " + fault); }

  bool read_header() {
    std::string line;
    if (!std::getline(in_, line)) fail("empty, or it can't be read");
    const bool binary = line.rfind("# Octomap OcTree binary file", 0) == 0;
    if (!binary && line.rfind("# Octomap OcTree file", 0) != 0) fail("not an OctoMap file (.ot or .bt)");
    std::string id;
    bool sized = false;
    while (true) {
      if (!std::getline(in_, line) || line.size() > 1000) fail("the OctoMap header ends before \"data\"");
      if (line == "data") break;
      if (line.empty() || line[0] == '#') continue;
      std::istringstream words(line);
      std::string word;
      words >> word;
      if (word == "id") words >> id;
      if (word == "size") sized = static_cast<bool>(words >> nodes_);
      if (word == "res") words >> file_.resolution_m;
      if (words.fail()) fail("bad OctoMap header line \"" + line + "\"");
    }
    if (id != "OcTree") fail("holds a tree of the kind \"" + id + "\"; an OcTree is needed");
    if (!sized || nodes_ > kMaxNodes) fail("the OctoMap header lacks a usable \"size\"");
    if (!(std::isfinite(file_.resolution_m) && file_.resolution_m > 0))
      fail("the OctoMap header lacks a positive \"res\"");
    return binary;
  }

  void read_bytes(char* bytes, std::size_t count) {
    if (!in_.read(bytes, static_cast<std::streamsize>(count))) fail("the OctoMap file is cut short");
  }

  void count_node() {
    if (++seen_ > nodes_) fail("damaged: more nodes than the header says (" + std::to_string(nodes_) + ")");
  }

  void add_leaf(const Key& corner, int depth, float log_odds) {
    if (!std::isfinite(log_odds)) fail("damaged: a node's value is not finite");
    file_.leaves.push_back({corner, 1 << (kTreeDepth - depth), log_odds});
  }

  static Key child_corner(const Key& corner, int depth, int child) {
    const int edge = 1 << (kTreeDepth - depth - 1);
    return {corner[0] + (child & 1) * edge, corner[1] + (child >> 1 & 1) * edge, corner[2] + (child >> 2 & 1) * edge};
  }

  // A node is its value and a byte that says which children follow.
  void read_node(const Key& corner, int depth) {
    count_node();
    std::array<char, 5> bytes{};
    read_bytes(bytes.data(), bytes.size());
    const auto children = static_cast<unsigned char>(bytes[4]);
    if (children == 0) {
      add_leaf(corner, depth, std::bit_cast<float>(std::array<char, 4>{bytes[0], bytes[1], bytes[2], bytes[3]}));
      return;
    }
    if (depth == kTreeDepth) fail("damaged: a node below the deepest level");
    for (int child = 0; child < 8; ++child) {
      if ((children >> child & 1) != 0) read_node(child_corner(corner, depth, child), depth + 1);
    }
  }

  // An inner node is two bits a child: 1 free leaf, 2 occupied leaf, 3 inner node, 0 none; the low bit comes first.
  void read_binary_node(const Key& corner, int depth) {
    count_node();
    if (depth == kTreeDepth) fail("damaged: a node below the deepest level");
    std::array<char, 2> bytes{};
    read_bytes(bytes.data(), bytes.size());
    const unsigned bits = static_cast<unsigned char>(bytes[0]) | unsigned{static_cast<unsigned char>(bytes[1])} << 8;
    for (int child = 0; child < 8; ++child) {
      const unsigned kind = bits >> (2 * child) & 3;
      if (kind == 0) continue;
      const Key at = child_corner(corner, depth, child);
      if (kind == 3) continue;
      count_node();
      add_leaf(at, depth + 1, kind == 1 ? free_ : occupied_);
    }
    for (int child = 0; child < 8; ++child) {
      if ((bits >> (2 * child) & 3) == 3) read_binary_node(child_corner(corner, depth, child), depth + 1);
    }
  }

  std::istream& in_;
  const std::string& name_;
  float free_, occupied_;
  std::uint64_t nodes_ = 0, seen_ = 0;
  OctomapFile file_;
};

}  // namespace

OctomapFile read_octomap(std::istream& in, const std::string& name, float free, float occupied) {
  return Reader(in, name, free, occupied).read();
}

}  // namespace vantage
