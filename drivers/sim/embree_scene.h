#pragma once

// Includes Embree: for the .cc files of this folder alone.

#include <stdexcept>

#include <embree3/rtcore.h>

#include "drivers/sim/mesh.h"

namespace vantage::sim {

/// Meshes that rays can be shot at, numbered in the order in which they were added; one without triangles is passed
/// over.
/// The tree is built by one thread, so that it, and with it every last bit of a hit, is the same each time.
class EmbreeScene {
 public:
  EmbreeScene() : device_(rtcNewDevice("threads=1")) {
    if (device_ == nullptr) throw std::runtime_error("Embree can't start on this machine");
    scene_ = rtcNewScene(device_);
    rtcSetSceneFlags(scene_, RTC_SCENE_FLAG_ROBUST);  // no ray slips through between two triangles
  }
  ~EmbreeScene() {
    rtcReleaseScene(scene_);
    rtcReleaseDevice(device_);
  }
  EmbreeScene(const EmbreeScene&) = delete;
  EmbreeScene& operator=(const EmbreeScene&) = delete;

  void add(const Mesh& mesh) {
    if (mesh.triangles.empty()) return;
    const RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
    auto* points = static_cast<float*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                                               3 * sizeof(float), mesh.points.size()));
    for (const Eigen::Vector3f& p : mesh.points) {
      for (int k = 0; k < 3; ++k) *points++ = p[k];
    }
    auto* indices = static_cast<unsigned*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                                                   3 * sizeof(unsigned), mesh.triangles.size()));
    for (const auto& triangle : mesh.triangles) {
      for (const std::uint32_t index : triangle) *indices++ = index;
    }
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene_, geometry);
    rtcReleaseGeometry(geometry);
  }

  /// After the last `add`.
  void commit() { rtcCommitScene(scene_); }

  RTCScene scene() const { return scene_; }

 private:
  RTCDevice device_;
  RTCScene scene_ = nullptr;
};

}  // namespace vantage::sim
