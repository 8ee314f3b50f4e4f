#pragma once

#include <string>

#include "calib/rig.h"
#include "drivers/camera/v4l2_camera.h"

namespace vantage {

/// Prints every camera of this machine with formats, sizes and frame rates. Exit status: 0, also without one.
int list_cameras();

/// A device that streams and is set as the rig says.
V4l2CameraOptions v4l2_options(const Rig& rig, const std::string& device);

/// Looks at what is connected and moves nothing. Either name may be empty: it is not looked at.
///
/// `camera`: v4l2:DEVICE or images:FOLDER; takes frames and tells format, rate, clock, settings and losses. `can`: an
/// interface or sim:SOCKET; sets every drive of the rig up, reads all back and tells where each stands; no drive gets
/// power. Prints what it finds; exit status 0, or 1 with the fault on the last line.
/// \throws InputError for a name that is not there, or a rig that describes no drives.
int check_hardware(const Rig& rig, const std::string& rig_path, const std::string& camera, const std::string& can);

}  // namespace vantage
