#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include <Eigen/Geometry>

#include "calib/camera_model.h"
#include "calib/drives_rig.h"

namespace vantage {

/// How the camera is set, so that frames can be compared. What is not told stays as the camera has it.
struct CaptureRig {
  double rate_hz = 30;
  std::optional<double> exposure_s;
  std::optional<int> gain;             ///< in the camera's own steps
  std::optional<int> white_balance_k;  ///< kelvin
};

/// One robot's measured geometry and the limits it is run at: what a rig file holds (calib/rigs/*.yaml).
struct Rig {
  CameraModel camera;  ///< the (left) camera
  CaptureRig capture;
  double stereo_baseline_m = 0;  ///< right camera at +x of the left one, same intrinsics; 0: a single camera
  Eigen::Isometry3d T_wrist_camera = Eigen::Isometry3d::Identity();
  /// Standard deviation of each coordinate of where the robot says its camera is.
  double kinematics_sigma_m = 0.002, kinematics_sigma_rad = 0.0035;
  double linear_speed_limit_m_s = 0;
  double angular_speed_limit_rad_s = 0;
  std::optional<DrivesRig> drives;  ///< of arm and base; none: the camera is carried otherwise
};

/// Reads a rig file. \throws InputError "file:line: key: …" for an unknown key, a wrong type or unit, a value that
/// makes no sense (a negative baseline, a camera that is not valid).
Rig load_rig(const std::filesystem::path& path);
/// The same from a text; `name` stands for the file in messages.
Rig parse_rig(const std::string& text, const std::string& name);

/// The camera of a recording and the unit of its depth images.
struct RecordingCamera {
  CameraModel camera;           ///< width and height are 0 when the file does not tell them
  double depth_unit_m = 0.001;  ///< metres of one step of a 16-bit depth image
};

/// Reads the camera.yaml of a recording in TUM layout: fx, fy, cx, cy in pixels; optionally width, height,
/// depth_scale_m and `distortion`: none, a list of four or five coefficients (radial-tangential), or radtan /
/// equidistant with the list under `coefficients`. Other keys are passed over: recordings come from elsewhere. \throws
/// InputError as load_rig.
RecordingCamera load_recording_camera(const std::filesystem::path& path);

}  // namespace vantage
