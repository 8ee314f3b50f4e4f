#include "offboard/lookahead/convolution.h"

#include <random>
#include <string>

#include <gtest/gtest.h>

namespace vantage {
namespace {

struct Layer {
  const char* name;
  int inputs, outputs, edge, stride;
  bool clip;
};

void PrintTo(const Layer& layer, std::ostream* out) { *out << layer.name; }

class Convolutions : public testing::TestWithParam<Layer> {
 protected:
  Convolutions() : in_(GetParam().inputs, {14, 6, 4}) {
    SCOPED_TRACE("seed " + std::to_string(seed_));
    const Layer& layer = GetParam();
    convolution_ = {layer.inputs, layer.outputs, layer.edge, layer.stride, layer.clip, {}, {}};
    const int taps = layer.edge * layer.edge * layer.edge;
    for (int i = 0; i < taps * layer.inputs * layer.outputs; ++i) convolution_.weights.push_back(number());
    for (int i = 0; i < layer.outputs; ++i) convolution_.bias.push_back(number());
    for (int z = 0; z < in_.size.z(); ++z) {
      for (int y = 0; y < in_.size.y(); ++y) {
        for (int x = 0; x < in_.size.x(); ++x) {
          for (int c = 0; c < in_.channels; ++c) in_.at(x, y, z)[c] = number();
        }
      }
    }
  }
  float number() { return std::uniform_real_distribution<float>(-1, 1)(random_); }

  /// By the definition, in double precision.
  double expected(int output, int x, int y, int z) const {
    const Layer& layer = GetParam();
    double sum = static_cast<double>(convolution_.bias[static_cast<std::size_t>(output)]);
    std::size_t weight = static_cast<std::size_t>(output);
    const int reach = layer.edge / 2;
    for (int dz = -reach; dz <= reach; ++dz) {
      for (int dy = -reach; dy <= reach; ++dy) {
        for (int dx = -reach; dx <= reach; ++dx) {
          const Eigen::Vector3i at(layer.stride * x + dx, layer.stride * y + dy, layer.stride * z + dz);
          const bool inside = (at.array() >= 0).all() && (at.array() < in_.size.array()).all();
          for (int i = 0; i < layer.inputs; ++i, weight += static_cast<std::size_t>(layer.outputs)) {
            if (inside) {
              sum += static_cast<double>(in_.at(at.x(), at.y(), at.z())[i]) *
                     static_cast<double>(convolution_.weights[weight]);
            }
          }
        }
      }
    }
    return layer.clip ? std::max(0.0, sum) : sum;
  }

  unsigned seed_ = std::random_device{}();
  std::mt19937 random_{seed_};
  Convolution convolution_;
  Feature in_;
};

TEST_P(Convolutions, IsWhatTheDefinitionSays) {
  SCOPED_TRACE("seed " + std::to_string(seed_));
  const Feature out = convolve(convolution_, in_);
  ASSERT_EQ(out.size, Eigen::Vector3i(in_.size / GetParam().stride));
  ASSERT_EQ(out.channels, GetParam().outputs);
  for (int z = 0; z < out.size.z(); ++z) {
    for (int y = 0; y < out.size.y(); ++y) {
      for (int x = 0; x < out.size.x(); ++x) {
        for (int c = 0; c < out.channels; ++c) {
          ASSERT_NEAR(static_cast<double>(out.at(x, y, z)[c]), expected(c, x, y, z), 1e-4)
              << c << " at " << x << " " << y << " " << z;
        }
      }
    }
  }
}

TEST_P(Convolutions, EveryInstructionSetGivesTheSameBits) {
  SCOPED_TRACE("seed " + std::to_string(seed_));
  const Feature first = convolve(convolution_, in_, 0);
  for (std::size_t kernel = 1; kernel < convolution_kernels(); ++kernel) {
    EXPECT_EQ(convolve(convolution_, in_, kernel).data, first.data) << "kernel " << kernel;
  }
}

TEST_P(Convolutions, TheBorderStaysZero) {
  const Feature out = convolve(convolution_, in_);
  for (int c = 0; c < out.channels; ++c) {
    EXPECT_EQ(out.at(-1, 0, 0)[c], 0);
    EXPECT_EQ(out.at(out.size.x(), 0, 0)[c], 0);
    EXPECT_EQ(out.at(0, -1, 1)[c], 0);
    EXPECT_EQ(out.at(0, 0, out.size.z())[c], 0);
  }
}

INSTANTIATE_TEST_SUITE_P(Layers, Convolutions,
                         testing::Values(Layer{"three", 13, 16, 3, 1, true}, Layer{"halving", 5, 32, 3, 2, true},
                                         Layer{"one", 24, 48, 1, 1, false}, Layer{"signed", 16, 16, 3, 1, false}),
                         [](const auto& layer) { return std::string(layer.param.name); });

}  // namespace
}  // namespace vantage
