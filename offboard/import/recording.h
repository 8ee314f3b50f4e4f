#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "calib/rig.h"
#include "lcmtypes/link/depth_map.h"

namespace vantage {

/// How a folder of depth images and poses is laid out.
enum class RecordingLayout {
  kSevenScenes,  ///< frame-NNNNNN.depth.png with frame-NNNNNN.pose.txt (4 x 4), together or in depth/ and depth_pose/
  kTum,          ///< depth.txt ("timestamp file") and groundtruth.txt (TUM trajectory), camera.yaml
  kTrajectory    ///< depth/TIMESTAMP.png and a TUM trajectory (groundtruth.txt or trajectory.txt), camera.yaml
};

/// One depth image and where it was taken.
struct RecordedDepth {
  double time_s = 0;
  std::filesystem::path image;  ///< 16-bit PNG; 0 and 65535 are no measurement
  Eigen::Isometry3d T_world_camera = Eigen::Isometry3d::Identity();
};

struct Recording {
  RecordingLayout layout{};
  RecordingCamera camera;
  std::vector<RecordedDepth> frames;  ///< in the order of time
  std::size_t without_pose = 0;       ///< depth images whose time is further than 20 ms from every pose: left out
};

/// Finds out what the folder holds (the first layout of the enum that fits, unless one is given) and reads poses.
/// `camera`, where given, replaces the folder's own. Without either, 7-Scenes' published depth camera (f 585 px,
/// 640 x 480) is taken for that layout; the others need a camera.yaml.
/// \throws InputError naming the folder or file and the mend.
Recording open_recording(const std::filesystem::path& folder, std::optional<RecordingLayout> layout = {},
                         const std::optional<RecordingCamera>& camera = {});

/// Noise of a structured-light depth camera: sigma_z = sigma_at_1m z^2, at least `least_sigma_m`. The default is the
/// Kinect's (Khoshelham and Elberink, Sensors 2012: 1.425 mm at 1 m).
struct DepthNoise {
  double sigma_at_1m = 0.001425;
  double least_sigma_m = 0.001;
};

/// Reads one image as a depth map: sigma from the noise model, depth edges marked, what lies beyond `max_depth_m` left
/// out as not measured.
/// \throws InputError naming the image: not a 16-bit grey PNG, not of the camera's size.
DepthMap read_recorded_depth(const RecordedDepth& frame, const RecordingCamera& camera, const DepthNoise& noise,
                             double max_depth_m);

}  // namespace vantage
