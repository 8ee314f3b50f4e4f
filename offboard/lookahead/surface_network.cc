#include "offboard/lookahead/surface_network.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "offboard/lookahead/surface_network_file.h"

namespace vantage {
namespace {

struct LayerShape {
  int inputs, outputs, edge, stride;
  bool clip;
};

// 0 is the window's resolution, 1 to 3 a half, a quarter, an eighth of it: down, and up again with what was known on
// the way down.
constexpr int kFine = 16, kHalf = 32, kQuarter = 48, kFromEighth = 32, kFromQuarter = 16;  // channels
constexpr int kLean = std::tuple_size_v<Lean>;
// clang-format off
enum Layer { kDown0, kStep1, kDown1, kStep2, kDown2, kStep3, kDown3, kRise3, kUp2, kRise2, kUp1, kRise1, kUp0, kOut, kLayers };
// clang-format on
constexpr std::array<LayerShape, kLayers> kShapes = {{
    {MapWindow::kChannels, kFine, 3, 1, true},       // kDown0
    {kFine, kHalf, 3, 2, true},                      // kStep1
    {kHalf, kHalf, 3, 1, true},                      // kDown1
    {kHalf, kQuarter, 3, 2, true},                   // kStep2
    {kQuarter, kQuarter, 3, 1, true},                // kDown2
    {kQuarter, kQuarter, 3, 2, true},                // kStep3
    {kQuarter, kQuarter, 3, 1, true},                // kDown3
    {kQuarter, kFromEighth, 1, 1, false},            // kRise3
    {kQuarter + kFromEighth, kQuarter, 3, 1, true},  // kUp2
    {kQuarter, kFromQuarter, 1, 1, false},           // kRise2
    {kHalf + kFromQuarter, kHalf, 3, 1, true},       // kUp1
    {kHalf, 8 * kFine, 1, 1, false},                 // kRise1
    {kFine, kFine, 3, 1, false},                     // kUp0
    {kFine, 1 + kLean, 1, 1, false},                 // kOut
}};

const Eigen::Vector3i kWindow(MapWindow::kWidth, MapWindow::kWidth, MapWindow::kHeight);
constexpr float kUnit = 127;  // of the window's numbers

constexpr std::string_view kMagic = "VANTAGE-SURFACE1";

/// Outputs come in groups of 16; what is beyond `outputs` is 0.
int in_groups(int outputs) { return (outputs + 15) / 16 * 16; }

float from_half(std::uint16_t half) {
  const std::uint32_t sign = std::uint32_t{half} >> 15 << 31, exponent = half >> 10 & 31U, fraction = half & 1023U;
  if (exponent == 0) return (sign != 0 ? -1.0F : 1.0F) * std::ldexp(static_cast<float>(fraction), -24);
  return std::bit_cast<float>(sign | (exponent + 112) << 23 | fraction << 13);
}

class Reader {
 public:
  explicit Reader(std::span<const unsigned char> bytes) : bytes_(bytes) {}
  template <typename T>
  T next() {
    if (bytes_.size() < sizeof(T)) throw std::invalid_argument("surface network: the file ends early");
    T value;
    std::memcpy(&value, bytes_.data(), sizeof value);
    bytes_ = bytes_.subspan(sizeof value);
    return value;
  }
  bool at_end() const { return bytes_.empty(); }

 private:
  std::span<const unsigned char> bytes_;
};

template <typename Visit>
void for_each_voxel(Visit&& visit) {
  Eigen::Vector3i v;
  std::size_t i = 0;
  for (v.z() = 0; v.z() < MapWindow::kHeight; ++v.z()) {
    for (v.y() = 0; v.y() < MapWindow::kWidth; ++v.y()) {
      for (v.x() = 0; v.x() < MapWindow::kWidth; ++v.x()) visit(static_cast<const Eigen::Vector3i&>(v), i++);
    }
  }
}

/// `coarse` twice as large, behind the channels of `fine`.
Feature joined(const Feature& fine, const Feature& coarse) {
  Feature out(fine.channels + coarse.channels, fine.size);
  for (int z = 0; z < out.size.z(); ++z) {
    for (int y = 0; y < out.size.y(); ++y) {
      for (int x = 0; x < out.size.x(); ++x) {
        float* to = std::copy_n(fine.at(x, y, z), fine.channels, out.at(x, y, z));
        std::copy_n(coarse.at(x / 2, y / 2, z / 2), coarse.channels, to);
      }
    }
  }
  return out;
}

/// Adds to each voxel its own eighth of the channels of `coarse`, then max(0, ·).
void add_eighths(const Feature& coarse, Feature* fine) {
  for (int z = 0; z < fine->size.z(); ++z) {
    for (int y = 0; y < fine->size.y(); ++y) {
      for (int x = 0; x < fine->size.x(); ++x) {
        const float* from = coarse.at(x / 2, y / 2, z / 2) + (x % 2 + 2 * (y % 2) + 4 * (z % 2));
        float* to = fine->at(x, y, z);
        for (int c = 0; c < fine->channels; ++c) to[c] = std::max(0.0F, to[c] + from[8 * c]);
      }
    }
  }
}

}  // namespace

const SurfaceNetwork& SurfaceNetwork::built_in() {
  static const SurfaceNetwork kNetwork(surface_network_file());
  return kNetwork;
}

SurfaceNetwork::SurfaceNetwork(std::span<const unsigned char> file) {
  Reader reader(file);
  for (const char c : kMagic) {
    if (reader.next<char>() != c) throw std::invalid_argument("surface network: not such a file");
  }
  for (const LayerShape& shape : kShapes) {
    Convolution layer{shape.inputs, in_groups(shape.outputs), shape.edge, shape.stride, shape.clip, {}, {}};
    const auto inputs = reader.next<std::uint32_t>(), outputs = reader.next<std::uint32_t>(),
               edge = reader.next<std::uint32_t>();
    if (std::cmp_not_equal(inputs, shape.inputs) || std::cmp_not_equal(outputs, shape.outputs) ||
        std::cmp_not_equal(edge, shape.edge)) {
      throw std::invalid_argument("surface network: a layer is of another shape than this program's");
    }
    const auto padded = static_cast<std::size_t>(layer.outputs);
    const std::size_t rows = static_cast<std::size_t>(edge) * edge * edge * inputs;
    layer.weights.assign(rows * padded, 0);
    layer.bias.assign(padded, 0);
    for (std::size_t row = 0; row < rows; ++row) {
      for (std::size_t o = 0; o < outputs; ++o)
        layer.weights[row * padded + o] = from_half(reader.next<std::uint16_t>());
    }
    for (std::size_t o = 0; o < outputs; ++o) layer.bias[o] = reader.next<float>();
    layers_.push_back(std::move(layer));
  }
  if (!reader.at_end()) throw std::invalid_argument("surface network: more in the file than layers");
}

ExpectedSurface SurfaceNetwork::expect(std::span<const MapWindow::Numbers> numbers) const {
  Feature input(MapWindow::kChannels, kWindow);
  for_each_voxel([&](const Eigen::Vector3i& v, std::size_t i) {
    float* channel = input.at(v.x(), v.y(), v.z());
    for (const std::int8_t number : numbers[i]) *channel++ = static_cast<float>(number) / kUnit;
  });
  const auto layer = [&](Layer which, const Feature& in) { return convolve(layers_[which], in); };
  const Feature down0 = layer(kDown0, input);
  const Feature down1 = layer(kDown1, layer(kStep1, down0));
  const Feature down2 = layer(kDown2, layer(kStep2, down1));
  const Feature down3 = layer(kDown3, layer(kStep3, down2));
  const Feature up2 = layer(kUp2, joined(down2, layer(kRise3, down3)));
  const Feature up1 = layer(kUp1, joined(down1, layer(kRise2, up2)));
  Feature up0 = layer(kUp0, down0);
  add_eighths(layer(kRise1, up1), &up0);
  const Feature answer = layer(kOut, up0);

  ExpectedSurface surface;
  surface.size = kWindow;
  surface.amount.resize(MapWindow::kVoxels);
  surface.lean.resize(MapWindow::kVoxels);
  for_each_voxel([&](const Eigen::Vector3i& v, std::size_t i) {
    const float* channel = answer.at(v.x(), v.y(), v.z());
    surface.amount[i] = static_cast<float>(kMost / (1 + std::exp(-static_cast<double>(channel[0]))));
    std::copy_n(channel + 1, kLean, surface.lean[i].begin());
  });
  return surface;
}

ExpectedSurface SurfaceNetwork::expect(const MapWindow& window) const {
  ExpectedSurface surface = expect(window.numbers());
  surface.min_corner = window.min_corner();
  return surface;
}

}  // namespace vantage
