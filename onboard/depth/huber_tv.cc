#include "onboard/depth/huber_tv.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

namespace vantage {
namespace {

constexpr int kBandRows = 16;

bool fail(std::string* why, const char* reason) {
  if (why != nullptr) *why = reason;
  return false;
}

}  // namespace

bool SmoothingOptions::valid(std::string* why) const {
  if (!(huber_epsilon > 0)) return fail(why, "smoothing: Huber's epsilon must be positive");
  if (!(strength > 0)) return fail(why, "smoothing: the strength must be positive");
  if (!(edge_alpha >= 0 && edge_beta > 0))
    return fail(why, "smoothing: alpha can't be negative, beta must be positive");
  if (!(sure_sigma > 0)) return fail(why, "smoothing: the sigma of sure pixels must be positive");
  if (!(least_data >= 0 && least_data <= 1)) return fail(why, "smoothing: the least weight lies between 0 and 1");
  if (iterations < 1) return fail(why, "smoothing: at least one iteration is needed");
  return true;
}

/// Row-major images of the size given; inverse depths are over their mean, so that options do not depend on the scale.
struct HuberTvSmoother::State {
  State(int w, int h, const SmoothingOptions& o, WorkerPool* p) : width(w), height(h), options(o), pool(p) {
    const std::size_t pixels = static_cast<std::size_t>(w) * static_cast<std::size_t>(h);
    for (auto* image : {&u, &u_bar, &f, &weight, &edge, &px, &py}) image->resize(pixels);
  }

  template <typename Work>
  void over_rows(Work&& work) {
    const int bands = (height + kBandRows - 1) / kBandRows;
    pool->run(bands, [&](int band) {
      for (int y = band * kBandRows; y < std::min(height, (band + 1) * kBandRows); ++y) work(y);
    });
  }

  std::size_t at(int y) const { return static_cast<std::size_t>(y) * static_cast<std::size_t>(width); }
  void set_edges(const GreyImage& image);
  bool set_data(const DepthMap& map);
  void ascend(int y, float sigma);
  void descend(int y, float tau);

  int width, height;
  SmoothingOptions options;
  WorkerPool* pool;
  float mean = 1;  ///< inverse depth
  std::vector<float> u, u_bar, f, weight, edge, px, py;
};

HuberTvSmoother::HuberTvSmoother(int width, int height, const SmoothingOptions& options, WorkerPool* pool)
    : state_(std::make_unique<State>(width, height, options, pool)) {
  if (std::string why; !options.valid(&why)) throw std::invalid_argument(why);
}

HuberTvSmoother::~HuberTvSmoother() = default;

/// g = strength * exp(-alpha |grad I|^beta), by forward differences as the gradient of u is taken.
void HuberTvSmoother::State::set_edges(const GreyImage& image) {
  over_rows([&](int y) {
    const std::uint8_t* row = image.pixels.get() + y * image.stride;
    const std::uint8_t* below = y + 1 < height ? row + image.stride : row;
    for (int x = 0; x < width; ++x) {
      const auto dx = static_cast<float>(x + 1 < width ? row[x + 1] - row[x] : 0) / 255;
      const auto dy = static_cast<float>(below[x] - row[x]) / 255;
      const float gradient = std::sqrt(dx * dx + dy * dy);
      edge[at(y) + static_cast<std::size_t>(x)] =
          static_cast<float>(options.strength) *
          std::exp(-static_cast<float>(options.edge_alpha) * std::pow(gradient, static_cast<float>(options.edge_beta)));
    }
  });
}

/// Data and weights: 1 for sure pixels and for the surest tenth of the converged ones, falling as their variance rises.
/// False when none has converged.
bool HuberTvSmoother::State::set_data(const DepthMap& map) {
  double sum = 0;
  std::size_t count = 0;
  std::vector<float>& relative = u_bar;  // sigma over inverse depth; room that is free here
  for (std::size_t i = 0; i < f.size(); ++i) {
    if (map.state[i] != DepthState::kConverged) continue;
    sum += 1 / map.depth_m[i];
    relative[count++] = map.sigma_m[i] / map.depth_m[i];
  }
  if (count == 0) return false;
  mean = static_cast<float>(sum / static_cast<double>(count));
  const auto surest = relative.begin() + static_cast<std::ptrdiff_t>(count / 10);
  std::nth_element(relative.begin(), surest, relative.begin() + static_cast<std::ptrdiff_t>(count));
  const float best = std::max(*surest, static_cast<float>(options.sure_sigma));
  const auto least = static_cast<float>(options.least_data);
  // Where nothing is known the search for a start takes the mean of what is known to the left.
  for (int y = 0; y < height; ++y) {
    float last = 1;
    for (std::size_t i = at(y); i < at(y) + static_cast<std::size_t>(width); ++i) {
      if (map.state[i] == DepthState::kConverged) {
        const float ratio = best * map.depth_m[i] / map.sigma_m[i];
        last = f[i] = 1 / (map.depth_m[i] * mean);
        weight[i] = std::clamp(ratio * ratio, least, 1.0F);
      } else {
        f[i] = last;
        weight[i] = 0;
      }
      u[i] = f[i];
    }
  }
  u_bar = u;
  std::fill(px.begin(), px.end(), 0.0F);
  std::fill(py.begin(), py.end(), 0.0F);
  return true;
}

/// p += sigma grad u_bar, shrunk as Huber's dual wants, then back into the ball of radius g.
void HuberTvSmoother::State::ascend(int y, float sigma) {
  const std::size_t row = at(y), below = y + 1 < height ? row + static_cast<std::size_t>(width) : row;
  const float shrink = 1 / (1 + sigma * static_cast<float>(options.huber_epsilon / options.strength));
  const float *v = u_bar.data() + row, *w = u_bar.data() + below, *g = edge.data() + row;
  float *p = px.data() + row, *q = py.data() + row;
  const auto step = [&](int x, float right) {
    const float a = (p[x] + sigma * (right - v[x])) * shrink, b = (q[x] + sigma * (w[x] - v[x])) * shrink;
    const float norm = std::sqrt(a * a + b * b);
    const float scale = norm > g[x] ? g[x] / norm : 1.0F;
    p[x] = a * scale;
    q[x] = b * scale;
  };
  for (int x = 0; x + 1 < width; ++x) step(x, v[x + 1]);
  step(width - 1, v[width - 1]);
}

/// u += tau div p, drawn to the data; u_bar looks ahead.
void HuberTvSmoother::State::descend(int y, float tau) {
  const std::size_t row = at(y);
  const float *p = px.data() + row, *q = py.data() + row, *data = f.data() + row, *w = weight.data() + row;
  const float* above = y > 0 ? q - width : nullptr;
  float *value = u.data() + row, *ahead = u_bar.data() + row;
  const auto step = [&](int x, float divergence) {
    const float next = (value[x] + tau * (divergence + w[x] * data[x])) / (1 + tau * w[x]);
    ahead[x] = 2 * next - value[x];
    value[x] = next;
  };
  const bool last = y + 1 == height;  // there the gradient's second part is 0 by construction
  step(0, p[0] + (last ? 0 : q[0]) - (above != nullptr ? above[0] : 0));
  if (above == nullptr) {
    for (int x = 1; x < width; ++x) step(x, p[x] - p[x - 1] + q[x]);
  } else if (last) {
    for (int x = 1; x < width; ++x) step(x, p[x] - p[x - 1] - above[x]);
  } else {
    for (int x = 1; x < width; ++x) step(x, p[x] - p[x - 1] + q[x] - above[x]);
  }
}

void HuberTvSmoother::smooth(const GreyImage& key_image, DepthMap* map) {
  State& s = *state_;
  if (key_image.width != s.width || key_image.height != s.height || map->depth_m.size() != s.u.size()) {
    throw std::invalid_argument("HuberTvSmoother: image or map of another size");
  }
  if (!s.set_data(*map)) return;
  s.set_edges(key_image);
  // sigma tau |grad|^2 <= 1, |grad|^2 <= 8. A long primal step: the data's weight is below 1.
  constexpr float kTau = 0.7F, kSigma = 1 / (8 * kTau);
  for (int i = 0; i < s.options.iterations; ++i) {
    s.over_rows([&](int y) { s.ascend(y, kSigma); });
    s.over_rows([&](int y) { s.descend(y, kTau); });
  }
  for (std::size_t i = 0; i < s.u.size(); ++i) {
    if (map->state[i] == DepthState::kConverged && s.u[i] > 0) map->depth_m[i] = 1 / (s.u[i] * s.mean);
  }
}

double HuberTvSmoother::energy() const {
  const State& s = *state_;
  const double epsilon = s.options.huber_epsilon / s.options.strength;
  double sum = 0;
  for (int y = 0; y < s.height; ++y) {
    for (int x = 0; x < s.width; ++x) {
      const std::size_t i = s.at(y) + static_cast<std::size_t>(x);
      const double dx = x + 1 < s.width ? s.u[i + 1] - s.u[i] : 0;
      const double dy = y + 1 < s.height ? s.u[i + static_cast<std::size_t>(s.width)] - s.u[i] : 0;
      const double norm = std::hypot(dx, dy), g = s.edge[i];
      // Huber with the corner at |p| = g: quadratic up to epsilon g.
      sum += norm <= epsilon * g ? norm * norm / (2 * epsilon) : g * norm - epsilon * g * g / 2;
      const double off = s.u[i] - s.f[i];
      sum += 0.5 * s.weight[i] * off * off;
    }
  }
  return sum / static_cast<double>(s.u.size());
}

}  // namespace vantage
