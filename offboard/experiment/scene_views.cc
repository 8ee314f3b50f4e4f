#include "offboard/experiment/scene_views.h"

#include <cmath>
#include <exception>
#include <fstream>
#include <iterator>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <thread>

#include <fmt/format.h>

#include "calib/files/atomic_file.h"
#include "calib/files/input_error.h"
#include "drivers/camera/stereo_depth.h"
#include "drivers/sim/stereo_camera.h"
#include "lcmtypes/link/depth_codec.h"
#include "lcmtypes/link/message.h"

namespace vantage {
namespace {

/// Poses in a file come back through a quaternion: as good as equal.
constexpr double kSamePose = 1e-9;

GreyImage image_of(const std::shared_ptr<std::vector<std::uint8_t>>& pixels, const CameraModel& camera) {
  return {camera.width, camera.height, camera.width, {pixels, pixels->data()}};
}

/// One thread's eyes.
class Eyes {
 public:
  Eyes(std::shared_ptr<const sim::Renderer> renderer, const sim::StereoOptions& options)
      : stereo_(std::move(renderer), options), matcher_(options.camera, options.baseline_m) {}

  depth_map_t look(const CandidateView& view) {
    const CameraModel& camera = stereo_.options().camera;
    const auto left = std::make_shared<std::vector<std::uint8_t>>(stereo_.pixels());
    const auto right = std::make_shared<std::vector<std::uint8_t>>(stereo_.pixels());
    stereo_.capture(view.T_world_camera, static_cast<std::uint64_t>(view.id), *left, *right);
    Frame frame;
    frame.sequence = static_cast<std::uint64_t>(view.id);
    frame.image = image_of(left, camera);
    frame.right_image = image_of(right, camera);
    frame.T_world_camera = view.T_world_camera;
    DepthMap map;
    std::string why;
    if (!matcher_.compute(frame, &map, &why)) throw std::logic_error("stereo: " + why);
    map.map_id = view.id + 1;
    map.view_id = view.id;
    return pack_depth_map(map);
  }

 private:
  sim::StereoCamera stereo_;
  StereoDepth matcher_;
};

}  // namespace

SceneViews::SceneViews(const ExperimentObject& object, std::vector<CandidateView> candidates, std::uint64_t seed,
                       std::filesystem::path folder)
    : object_(object),
      candidates_(std::move(candidates)),
      seed_(seed),
      folder_(std::move(folder)),
      packed_(candidates_.size()) {}

std::filesystem::path SceneViews::file_of(std::size_t candidate) const {
  return folder_ / fmt::format("view-{:03}.depth", candidates_[candidate].id);
}

std::size_t SceneViews::files_missing() const {
  std::size_t missing = 0;
  for (std::size_t i = 0; i < candidates_.size(); ++i) missing += !std::filesystem::exists(file_of(i));
  return missing;
}

/// Takes a view from its file, if that holds this view.
bool SceneViews::load(std::size_t candidate) {
  if (folder_.empty()) return false;
  std::ifstream stream(file_of(candidate), std::ios::binary);
  if (!stream) return false;
  const std::vector<char> bytes{std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
  depth_map_t message;
  DecodeCounters ignored;
  std::string why;
  if (!decode_message<depth_map_t>({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()}, &message,
                                   &ignored)) {
    return false;
  }
  const std::optional<DepthMap> map = unpack_depth_map(message, &why);
  const CandidateView& view = candidates_[candidate];
  if (!map || map->view_id != view.id || !map->T_world_camera.isApprox(view.T_world_camera, kSamePose)) return false;
  packed_[candidate] = std::move(message);
  return true;
}

bool SceneViews::prepare(int threads, const std::atomic<bool>& stop,
                         const std::function<void(int done, int missing)>& made) {
  if (!folder_.empty()) {
    std::error_code error;
    std::filesystem::create_directories(folder_, error);
    if (error) throw InputError(folder_.string() + ": can't be made: " + error.message());
  }
  std::vector<std::size_t> missing;
  for (std::size_t i = 0; i < candidates_.size(); ++i) {
    if (packed_[i].size == 0 && !load(i)) missing.push_back(i);
  }
  if (missing.empty()) return true;

  sim::World world;
  world.object = object_.mesh;
  world.texture_seed = static_cast<std::uint32_t>(seed_);
  sim::StereoOptions options;
  options.seed = seed_;
  const auto renderer = std::make_shared<const sim::Renderer>(world, 1);
  std::atomic<std::size_t> next = 0;
  std::mutex mutex;  // guards done, failure, and calls of `made`
  int done = 0;
  std::exception_ptr failure;
  const auto work = [&] {
    try {
      Eyes eyes(renderer, options);
      for (std::size_t i = next++; i < missing.size() && !stop; i = next++) {
        packed_[missing[i]] = eyes.look(candidates_[missing[i]]);
        if (!folder_.empty()) {
          const std::vector<std::uint8_t> bytes = encode_message(packed_[missing[i]]);
          AtomicFile file(file_of(missing[i]));
          file.stream().write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
          file.commit();
        }
        const std::lock_guard lock(mutex);
        made(++done, static_cast<int>(missing.size()));
      }
    } catch (...) {
      const std::lock_guard lock(mutex);
      failure = std::current_exception();
      next = missing.size();
    }
  };
  std::vector<std::thread> others;
  for (int i = 1; i < threads; ++i) others.emplace_back(work);
  work();
  for (std::thread& thread : others) thread.join();
  if (failure) std::rethrow_exception(failure);
  return done == static_cast<int>(missing.size());
}

DepthMap SceneViews::depth_map(std::size_t candidate) const {
  std::string why;
  std::optional<DepthMap> map = unpack_depth_map(packed_.at(candidate), &why);
  if (!map) throw std::logic_error("a depth map that does not unpack: " + why);
  return std::move(*map);
}

}  // namespace vantage
