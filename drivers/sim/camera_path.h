#pragma once

#include <string>
#include <vector>

#include "calib/files/trajectory.h"

namespace vantage::sim {

/// How a camera moves in boxes_room().
enum class CameraPath {
  kHover,    ///< small figures in the air, +-5 cm and +-2 degrees, 1.4 m from what it looks at
  kSlide,    ///< sideways at 10 cm/s, looking ahead and down
  kForward,  ///< towards what it looks at, at 10 cm/s
  kCircle,   ///< once around the room's centre in 20 s, 1.3 m away, looking inwards
  kRotate,   ///< turns about its own centre without moving, +-15 degrees
  kTurn,     ///< 20 cm sideways in 2 s, then turns to +-25 degrees at up to 45 degrees/s without moving
  kDash      ///< rests, then dashes 25 cm aside with a turn of 6 degrees in 0.4 s, rests, and back; once in 2 s
};

/// The names on a command line: hover, slide, forward, circle, rotate, turn, dash.
/// \throws InputError that lists them, for any other.
CameraPath camera_path_named(const std::string& name);

/// Where the camera is `time_s` after the start. Smooth; the same every time.
Eigen::Isometry3d pose_on_path(CameraPath path, double time_s);

}  // namespace vantage::sim
