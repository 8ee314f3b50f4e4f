#include "drivers/sim/renderer.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>
#include <limits>
#include <thread>

#include "drivers/sim/embree_scene.h"
#include "drivers/sim/texture.h"

namespace vantage::sim {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

/// Rotated grid: no two samples share a row or a column, so that slanting edges are smoothed in both directions.
constexpr double kSampleX[kSamplesPerPixel] = {-0.375, 0.125, 0.375, -0.125};
constexpr double kSampleY[kSamplesPerPixel] = {-0.125, -0.375, 0.125, 0.375};

/// Shadow rays start this far off the surface, or a surface would shade itself.
constexpr float kShadowOffset_m = 2e-4F;

/// The order in which geometries are added to the scene of all there is.
enum : unsigned { kRoomId = 0, kObjectId = 1 };

/// Runs `row(v)` for every row on several threads; which thread takes which row has no influence on the result.
void for_each_row(int rows, int threads, const std::function<void(int)>& row) {
  std::atomic<int> next{0};
  const auto work = [&] {
    for (int v = next++; v < rows; v = next++) row(v);
  };
  std::vector<std::thread> others;
  for (int i = 1; i < threads; ++i) others.emplace_back(work);
  work();
  for (std::thread& other : others) other.join();
}

/// Directions of a camera's rays in the world, scaled to a z of 1 in the camera frame: then the ray parameter of a hit
/// is its depth.
class Rays {
 public:
  Rays(const CameraModel& camera, const Eigen::Isometry3d& T_world_camera)
      : camera_(camera), rotation_(T_world_camera.linear()), origin_(T_world_camera.translation().cast<float>()) {}

  const Eigen::Vector3f& origin() const { return origin_; }

  /// False where the lens maps no ray to the pixel, or one sideways or backwards, which has no depth.
  bool direction(double u, double v, Eigen::Vector3f* direction) const {
    Eigen::Vector3d ray;
    if (camera_.distortion == Distortion::kNone) {
      ray = {(u - camera_.cx) / camera_.fx, (v - camera_.cy) / camera_.fy, 1};
    } else {
      if (!camera_.unproject({u, v}, &ray) || ray.z() < 1e-3) return false;
      ray /= ray.z();
    }
    *direction = (rotation_ * ray).cast<float>();
    return true;
  }

 private:
  const CameraModel& camera_;
  Eigen::Matrix3d rotation_;
  Eigen::Vector3f origin_;
};

/// Four rays that share an origin, ready to be shot.
struct alignas(16) Packet {
  int valid[4];
  RTCRayHit4 hits;

  explicit Packet(const Eigen::Vector3f& origin) {
    for (int i = 0; i < 4; ++i) {
      valid[i] = 0;
      hits.ray.org_x[i] = origin.x();
      hits.ray.org_y[i] = origin.y();
      hits.ray.org_z[i] = origin.z();
      hits.ray.dir_x[i] = hits.ray.dir_y[i] = 0;
      hits.ray.dir_z[i] = 1;
      hits.ray.tnear[i] = hits.ray.time[i] = 0;
      hits.ray.tfar[i] = kInfinity;
      hits.ray.mask[i] = ~0U;
      hits.ray.id[i] = hits.ray.flags[i] = 0;
      hits.hit.geomID[i] = hits.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
    }
  }

  void aim(int i, const Eigen::Vector3f& direction) {
    valid[i] = -1;
    hits.ray.dir_x[i] = direction.x();
    hits.ray.dir_y[i] = direction.y();
    hits.ray.dir_z[i] = direction.z();
  }

  void shoot(RTCScene scene) {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    rtcIntersect4(valid, scene, &context, &hits);
  }

  bool hit(int i) const { return hits.hit.geomID[i] != RTC_INVALID_GEOMETRY_ID; }

  Surface surface(int i) const {
    if (!hit(i)) return Surface::kNone;
    if (hits.hit.geomID[i] == kObjectId) return Surface::kObject;
    return hits.hit.primID[i] < kGroundTriangles ? Surface::kGround : Surface::kWall;
  }

  /// The surface's unit normal, on the side that the ray came from.
  Eigen::Vector3f normal(int i) const {
    Eigen::Vector3f n(hits.hit.Ng_x[i], hits.hit.Ng_y[i], hits.hit.Ng_z[i]);
    n.normalize();
    return n.dot(Eigen::Vector3f(hits.ray.dir_x[i], hits.ray.dir_y[i], hits.ray.dir_z[i])) > 0 ? Eigen::Vector3f(-n)
                                                                                               : n;
  }

  Eigen::Vector3f point(int i) const {
    const float t = hits.ray.tfar[i];
    return {hits.ray.org_x[i] + t * hits.ray.dir_x[i], hits.ray.org_y[i] + t * hits.ray.dir_y[i],
            hits.ray.org_z[i] + t * hits.ray.dir_z[i]};
  }
};

}  // namespace

struct Renderer::Implementation {
  World world;
  int threads = 1;
  EmbreeScene all;
  EmbreeScene object;  // what casts a shadow

  Float4 reflectance(const Packet& packet, float pixel_per_m) const;
  Float4 illumination(const Packet& packet) const;
};

/// The pattern at the four hits. They nearly always lie on one surface; each further one costs another look.
Float4 Renderer::Implementation::reflectance(const Packet& packet, float pixel_per_m) const {
  Float4 x{}, y{}, z{}, footprint{1, 1, 1, 1};
  for (int i = 0; i < 4; ++i) {
    if (!packet.hit(i)) continue;
    const Eigen::Vector3f p = packet.point(i);
    x[i] = p.x();
    y[i] = p.y();
    z[i] = p.z();
    footprint[i] = std::max(packet.hits.ray.tfar[i] / pixel_per_m, 1e-6F);
  }
  Float4 result{};
  for (const Surface surface : {Surface::kGround, Surface::kWall, Surface::kObject}) {
    bool any = false;
    for (int i = 0; i < 4; ++i) any |= packet.surface(i) == surface;
    if (!any) continue;
    const Float4 pattern = solid_texture(x, y, z, footprint, texture_seed(world, surface));
    for (int i = 0; i < 4; ++i) {
      if (packet.surface(i) == surface) result[i] = pattern[i];
    }
  }
  return result;
}

/// Light that falls on the four hits: ambient by the normal's height, and the lamp (Lambert) where the object does not
/// stand between.
Float4 Renderer::Implementation::illumination(const Packet& packet) const {
  const auto up = static_cast<float>(world.light.ambient_up), down = static_cast<float>(world.light.ambient_down);
  const Eigen::Vector3f lamp = world.light.position.cast<float>();
  Float4 light{};
  alignas(16) int towards[4] = {0, 0, 0, 0};
  alignas(16) RTCRay4 rays{};
  float lambert[4] = {0, 0, 0, 0};
  bool any = false;
  for (int i = 0; i < 4; ++i) {
    if (!packet.hit(i)) continue;
    const Eigen::Vector3f n = packet.normal(i);
    light[i] = down + (up - down) * 0.5F * (1 + n.z());
    const Eigen::Vector3f from = packet.point(i) + kShadowOffset_m * n, to_lamp = lamp - from;
    lambert[i] = n.dot(to_lamp) / to_lamp.norm();
    if (!(lambert[i] > 0)) continue;
    any = true;
    towards[i] = -1;
    rays.org_x[i] = from.x();
    rays.org_y[i] = from.y();
    rays.org_z[i] = from.z();
    rays.dir_x[i] = to_lamp.x();
    rays.dir_y[i] = to_lamp.y();
    rays.dir_z[i] = to_lamp.z();
    rays.tfar[i] = 1;
    rays.mask[i] = ~0U;
  }
  if (!any) return light;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  rtcOccluded4(towards, object.scene(), &context, &rays);
  for (int i = 0; i < 4; ++i) {
    // Embree sets tfar to minus infinity where something is in the way.
    if (towards[i] != 0 && rays.tfar[i] > 0) light[i] += static_cast<float>(world.light.lamp) * lambert[i];
  }
  return light;
}

Renderer::Renderer(const World& world, int threads) {
  auto implementation = std::make_unique<Implementation>();
  implementation->world = world;
  implementation->threads = threads > 0 ? threads : static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  implementation->all.add(room_mesh(world.room));
  implementation->all.add(world.object);
  implementation->all.commit();
  implementation->object.add(world.object);
  implementation->object.commit();
  implementation_ = std::move(implementation);
}

Renderer::~Renderer() = default;

void Renderer::render(const CameraModel& camera, const Eigen::Isometry3d& T_world_camera,
                      std::vector<float>* radiance) const {
  static_assert(kSamplesPerPixel == 4, "a pixel's samples are one packet of rays");
  const Rays rays(camera, T_world_camera);
  const auto width = static_cast<std::size_t>(camera.width);
  const auto pixel_per_m = static_cast<float>(camera.fx);
  radiance->assign(width * static_cast<std::size_t>(camera.height), 0);
  for_each_row(camera.height, implementation_->threads, [&](int v) {
    float* row = radiance->data() + width * static_cast<std::size_t>(v);
    for (int u = 0; u < camera.width; ++u) {
      Packet packet(rays.origin());
      for (int i = 0; i < kSamplesPerPixel; ++i) {
        Eigen::Vector3f direction;
        if (rays.direction(u + kSampleX[i], v + kSampleY[i], &direction)) packet.aim(i, direction);
      }
      packet.shoot(implementation_->all.scene());
      const Float4 samples = implementation_->reflectance(packet, pixel_per_m) * implementation_->illumination(packet);
      row[u] = 0.25F * ((samples[0] + samples[1]) + (samples[2] + samples[3]));
    }
  });
}

void Renderer::depth(const CameraModel& camera, const Eigen::Isometry3d& T_world_camera,
                     std::vector<float>* depth_m) const {
  const Rays rays(camera, T_world_camera);
  const auto width = static_cast<std::size_t>(camera.width);
  depth_m->assign(width * static_cast<std::size_t>(camera.height), kInfinity);
  for_each_row(camera.height, implementation_->threads, [&](int v) {
    float* row = depth_m->data() + width * static_cast<std::size_t>(v);
    for (int first = 0; first < camera.width; first += 4) {
      Packet packet(rays.origin());
      for (int i = 0; i < 4; ++i) {
        Eigen::Vector3f direction;
        if (first + i < camera.width && rays.direction(first + i, v, &direction)) packet.aim(i, direction);
      }
      packet.shoot(implementation_->all.scene());
      for (int i = 0; i < 4; ++i) {
        if (packet.hit(i)) row[first + i] = packet.hits.ray.tfar[i];
      }
    }
  });
}

}  // namespace vantage::sim
