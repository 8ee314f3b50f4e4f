#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>

#include "calib/camera_model.h"
#include "drivers/sim/camera_path.h"
#include "drivers/sim/world.h"

namespace vantage::sim {

/// What a single simulated camera records, and what goes wrong meanwhile.
struct RecordingOptions {
  CameraModel camera{.width = 640, .height = 480, .fx = 460, .fy = 460, .cx = 319.5, .cy = 239.5};
  CameraPath path = CameraPath::kHover;
  int frames = 60;
  double frames_per_s = 30;
  std::uint64_t seed = 1;      ///< of the noise
  double noise_sigma = 2;      ///< grey levels
  int truth_depth_every = 0;   ///< writes the exact depth of every so many frames; 0: of none
  double exposure_s = 0;       ///< the shutter is open so long, which blurs; the brightness does not depend on it
  double light_swing = 0;      ///< the light goes up and down by this share, once in 3 s
  double covered_from_s = -1;  ///< the lens is covered from here ...
  double covered_to_s = -1;    ///< ... to here
  double jump_at_s = -1;       ///< from here on the camera is turned to the side by ...
  double jump_deg = 0;         ///< ... so much

  bool valid(std::string* why = nullptr) const;
};

/// Writes a recording in TUM layout: rgb/NNNN.png, rgb.txt, groundtruth.txt, camera.yaml and, when asked for,
/// depth/NNNN.png (16 bit, 0.1 mm a step) with depth.txt. The folder must not hold one yet. `progress` is called after
/// every frame with how many are done; false from it ends the recording there, readable.
/// \throws InputError when something can't be written.
void write_recording(const World& world, const RecordingOptions& options, const std::filesystem::path& folder,
                     const std::function<bool(int)>& progress = {});

}  // namespace vantage::sim
