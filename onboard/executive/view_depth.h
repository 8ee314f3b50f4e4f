#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "drivers/camera/frame_source.h"
#include "lcmtypes/link/depth_map.h"

namespace vantage {

/// Where the key frame of a depth map stands by what is known now.
struct KeyPose {
  std::int64_t utime = 0;  ///< the map's
  Eigen::Isometry3d T_world_camera = Eigen::Isometry3d::Identity();
};

/// How the depth of what a view shows is measured: from one exposure of a stereo pair, or from a single camera that is
/// moved a little. Called by the executive's thread alone:
///
///     depth.begin(frame at the view);
///     while (pose = depth.next_pose()) { carry the camera to *pose; depth.add(frame from there); }
///     depth.finish(&map, &why);
///
/// The executive may break off between any two calls; the next one is then `pass` or `begin`.
class ViewDepth {
 public:
  virtual ~ViewDepth() = default;

  /// Whether frames like this one can be used. If not, `why` says so.
  virtual bool fits(const Frame& frame, std::string* why) = 0;

  /// Whether it wants to see frames from the way between views, too.
  virtual bool watches_the_way() const = 0;
  virtual void pass(const Frame& frame) = 0;

  /// The key frame, taken from the view.
  virtual void begin(const Frame& key) = 0;
  /// Where the camera is to take the next frame, T_world_camera; nothing when there are enough.
  virtual std::optional<Eigen::Isometry3d> next_pose() = 0;
  virtual void add(const Frame& frame) = 0;
  /// The key frame's depth, but for the ids. False, with the reason, when the key frame could not be used.
  virtual bool finish(DepthMap* map, std::string* why) = 0;

  /// Key frames of finished maps that are now known to stand elsewhere than their map, or an earlier call, said.
  virtual std::vector<KeyPose> corrections() { return {}; }
};

}  // namespace vantage
