#include "lcmtypes/link/depth_codec.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <zstd.h>

#include "lcmtypes/link/pose_fields.h"

namespace vantage {
namespace {

constexpr int kCompressionLevel = 1;  // of zstd: higher ones gain 3 % and cost three times the time
constexpr std::int64_t kMostPixels = std::int64_t{1} << 24;
constexpr std::size_t kBytesPerPixel = 4;  // depth high, depth low, sigma, state
constexpr double kSmallestSigma = 1e-6, kLargestSigma = 10;
constexpr int kDepthSteps = 65535, kSigmaSteps = 255;
constexpr double kStepsPerSigma = 8;  // finer differences of depth are noise, which no code makes smaller
constexpr int kMostNoiseBits = 12;

bool has_depth(DepthState state) { return state != DepthState::kInvalid && state != DepthState::kDiverged; }

std::uint8_t sigma_code(float sigma) {
  const double position =
      std::log(static_cast<double>(sigma) / kSmallestSigma) / std::log(kLargestSigma / kSmallestSigma);
  return static_cast<std::uint8_t>(std::lround(std::clamp(position, 0.0, 1.0) * kSigmaSteps));
}

float sigma_of(std::uint8_t code) {
  return static_cast<float>(kSmallestSigma * std::pow(kLargestSigma / kSmallestSigma, code / double{kSigmaSteps}));
}

/// A code for inverse depth, with as many of its low bits 0 as hide in the noise: at least eight steps a sigma are
/// left.
std::uint16_t depth_code(double position, double sigma_steps) {
  const int bits = std::clamp(std::ilogb(std::max(sigma_steps / kStepsPerSigma, 1.0)), 0, kMostNoiseBits);
  const double coarse = std::ldexp(std::round(std::ldexp(position, -bits)), bits);
  return static_cast<std::uint16_t>(std::min(coarse, double{kDepthSteps}));
}

/// Four planes, each byte the difference to its left neighbour: smooth images become runs of small numbers.
class Planes {
 public:
  Planes(std::size_t pixels, std::size_t width) : pixels_(pixels), width_(width), bytes_(kBytesPerPixel * pixels) {}

  std::vector<std::uint8_t>& bytes() { return bytes_; }

  void set(std::size_t pixel, std::uint16_t depth, std::uint8_t sigma, std::uint8_t state) {
    if (pixel % width_ == 0) last_depth_ = last_sigma_ = last_state_ = 0;
    const auto step = static_cast<std::uint16_t>(depth - last_depth_);
    bytes_[pixel] = static_cast<std::uint8_t>(step >> 8);
    bytes_[pixels_ + pixel] = static_cast<std::uint8_t>(step);
    bytes_[2 * pixels_ + pixel] = static_cast<std::uint8_t>(sigma - last_sigma_);
    bytes_[3 * pixels_ + pixel] = static_cast<std::uint8_t>(state - last_state_);
    last_depth_ = depth, last_sigma_ = sigma, last_state_ = state;
  }

  void get(std::size_t pixel, std::uint16_t* depth, std::uint8_t* sigma, std::uint8_t* state) {
    if (pixel % width_ == 0) last_depth_ = last_sigma_ = last_state_ = 0;
    const int step = bytes_[pixel] << 8 | bytes_[pixels_ + pixel];
    *depth = last_depth_ = static_cast<std::uint16_t>(last_depth_ + step);
    *sigma = last_sigma_ = static_cast<std::uint8_t>(last_sigma_ + bytes_[2 * pixels_ + pixel]);
    *state = last_state_ = static_cast<std::uint8_t>(last_state_ + bytes_[3 * pixels_ + pixel]);
  }

 private:
  std::size_t pixels_, width_;
  std::vector<std::uint8_t> bytes_;
  std::uint16_t last_depth_ = 0;
  std::uint8_t last_sigma_ = 0, last_state_ = 0;
};

}  // namespace

depth_map_t pack_depth_map(const DepthMap& map) {
  depth_map_t message{};
  message.utime = map.utime;
  message.session = static_cast<std::int64_t>(map.session);
  message.map_id = map.map_id;
  message.goal_id = map.goal_id;
  message.view_id = map.view_id;
  message.width = map.camera.width;
  message.height = map.camera.height;
  message.focal_length[0] = map.camera.fx;
  message.focal_length[1] = map.camera.fy;
  message.principal_point[0] = map.camera.cx;
  message.principal_point[1] = map.camera.cy;
  set_pose(map.T_world_camera, &message);

  double lowest = 0, highest = 0;  // inverse depth, 1/m
  for (std::size_t i = 0; i < map.depth_m.size(); ++i) {
    if (!has_depth(map.state[i])) continue;
    const double inverse = 1.0 / static_cast<double>(map.depth_m[i]);
    lowest = lowest == 0 ? inverse : std::min(lowest, inverse);
    highest = std::max(highest, inverse);
  }
  if (lowest == 0) lowest = highest = 1;  // no pixel has depth
  message.inverse_depth_range[0] = lowest;
  message.inverse_depth_range[1] = highest;
  const double scale = highest > lowest ? kDepthSteps / (highest - lowest) : 0;

  Planes planes(map.depth_m.size(), static_cast<std::size_t>(map.camera.width));
  std::uint16_t depth = 0;
  std::uint8_t sigma = 0;
  for (std::size_t i = 0; i < map.depth_m.size(); ++i) {
    if (has_depth(map.state[i])) {  // elsewhere the last codes go on: a difference of 0
      const double inverse = 1.0 / static_cast<double>(map.depth_m[i]);
      depth = depth_code((inverse - lowest) * scale, static_cast<double>(map.sigma_m[i]) * inverse * inverse * scale);
      sigma = sigma_code(map.sigma_m[i]);
    }
    planes.set(i, depth, sigma, static_cast<std::uint8_t>(map.state[i]));
  }
  message.images.resize(ZSTD_compressBound(planes.bytes().size()));
  const std::size_t size = ZSTD_compress(message.images.data(), message.images.size(), planes.bytes().data(),
                                         planes.bytes().size(), kCompressionLevel);
  if (ZSTD_isError(size) != 0) throw std::runtime_error(std::string("zstd: ") + ZSTD_getErrorName(size));
  message.images.resize(size);
  message.size = static_cast<std::int32_t>(size);
  return message;
}

std::optional<DepthMap> unpack_depth_map(const depth_map_t& message, std::string* why) {
  const auto refuse = [why](std::string reason) {
    *why = std::move(reason);
    return std::nullopt;
  };
  DepthMap map;
  map.utime = message.utime;
  map.session = static_cast<std::uint64_t>(message.session);
  map.map_id = message.map_id;
  map.goal_id = message.goal_id;
  map.view_id = message.view_id;
  map.camera.width = message.width;
  map.camera.height = message.height;
  map.camera.fx = message.focal_length[0];
  map.camera.fy = message.focal_length[1];
  map.camera.cx = message.principal_point[0];
  map.camera.cy = message.principal_point[1];
  if (!map.camera.valid(why)) return std::nullopt;
  if (std::int64_t{message.width} * message.height > kMostPixels) return refuse("the image has more than 2^24 pixels");
  const double lowest = message.inverse_depth_range[0], highest = message.inverse_depth_range[1];
  if (!(std::isfinite(lowest) && std::isfinite(highest) && lowest > 0 && highest >= lowest)) {
    return refuse("the range of inverse depth is not positive and rising");
  }
  const std::optional<Eigen::Isometry3d> pose = pose_of(message);
  if (!pose) return refuse("the pose T_world_camera is not finite or not a rotation");
  map.T_world_camera = *pose;

  const std::size_t pixels = static_cast<std::size_t>(message.width) * static_cast<std::size_t>(message.height);
  Planes planes(pixels, static_cast<std::size_t>(message.width));
  const std::size_t size =
      ZSTD_decompress(planes.bytes().data(), planes.bytes().size(), message.images.data(), message.images.size());
  if (ZSTD_isError(size) != 0 || size != planes.bytes().size()) return refuse("the images do not unpack to their size");
  map.depth_m.resize(pixels);
  map.sigma_m.resize(pixels);
  map.state.resize(pixels);
  const double step = (highest - lowest) / kDepthSteps;
  for (std::size_t i = 0; i < pixels; ++i) {
    std::uint16_t depth = 0;
    std::uint8_t sigma = 0, state = 0;
    planes.get(i, &depth, &sigma, &state);
    map.state[i] = static_cast<DepthState>(state);
    if (!has_depth(map.state[i])) continue;
    map.depth_m[i] = static_cast<float>(1 / (lowest + step * depth));
    map.sigma_m[i] = sigma_of(sigma);
  }
  if (!map.valid(why)) return std::nullopt;
  return map;
}

}  // namespace vantage
