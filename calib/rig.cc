#include "calib/rig.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "calib/files/strict_yaml.h"

namespace vantage {
namespace {

constexpr std::int64_t kRigFileVersion = 1;
/// A quaternion typed with four decimals is off unit length by less than this.
constexpr double kQuaternionTolerance = 1e-3;

/// Number of coefficients each model takes at least and at most.
struct CoefficientCount {
  std::size_t least, most;
};

Distortion read_distortion(YamlMap& map, std::string_view model_key, CoefficientCount* count) {
  const std::string name = map.text(model_key);
  if (name == "pinhole") return *count = {0, 0}, Distortion::kNone;
  if (name == "radtan") return *count = {4, 5}, Distortion::kRadTan;
  if (name == "equidistant") return *count = {4, 4}, Distortion::kEquidistant;
  map.fail(model_key, "expected pinhole, radtan or equidistant, found \"" + name + "\"");
}

void read_coefficients(YamlMap& map, std::string_view key, CoefficientCount count, CameraModel* camera) {
  const std::vector<double> values = map.has(key) ? map.numbers(key, 0) : std::vector<double>{};
  if (values.size() < count.least || values.size() > count.most) {
    map.fail(key, "this camera model takes " + std::to_string(count.least) +
                      (count.most > count.least ? " or " + std::to_string(count.most) : "") + " coefficients, found " +
                      std::to_string(values.size()));
  }
  std::copy(values.begin(), values.end(), camera->coefficients.begin());
}

double read_positive(YamlMap& map, std::string_view key, Quantity kind) {
  const double value = map.quantity(key, kind);
  if (value <= 0) map.fail(key, "must be positive");
  return value;
}

int read_image_side(YamlMap& map, std::string_view key) {
  constexpr std::int64_t kLargest = 1 << 15;
  const std::int64_t value = map.integer(key);
  if (value <= 0 || value > kLargest) map.fail(key, "expected 1 to " + std::to_string(kLargest) + " pixels");
  return static_cast<int>(value);
}

std::optional<int> read_steps(YamlMap& map, std::string_view key) {
  if (!map.has(key)) return {};
  const std::int64_t value = map.integer(key);
  if (value < 0 || value > 1'000'000) map.fail(key, "expected 0 to 1000000");
  return static_cast<int>(value);
}

CaptureRig read_capture(YamlMap& map) {
  CaptureRig capture;
  if (map.has("frame_rate")) capture.rate_hz = read_positive(map, "frame_rate", Quantity::kFrequency);
  if (map.has("exposure")) capture.exposure_s = read_positive(map, "exposure", Quantity::kDuration);
  capture.gain = read_steps(map, "gain");
  capture.white_balance_k = read_steps(map, "white_balance_kelvin");
  return capture;
}

CameraModel read_rig_camera(YamlMap map, CaptureRig* capture) {
  CameraModel camera;
  CoefficientCount count{};
  camera.distortion = read_distortion(map, "model", &count);
  camera.width = read_image_side(map, "width");
  camera.height = read_image_side(map, "height");
  const std::vector<double> focal = map.quantities("focal_length", Quantity::kPixels, 2);
  const std::vector<double> centre = map.quantities("principal_point", Quantity::kPixels, 2);
  camera.fx = focal[0], camera.fy = focal[1], camera.cx = centre[0], camera.cy = centre[1];
  read_coefficients(map, "distortion", count, &camera);
  if (std::string why; !camera.valid(&why)) map.fail("focal_length", why);
  *capture = read_capture(map);
  map.finish();
  return camera;
}

Eigen::Isometry3d read_pose(YamlMap map) {
  const std::vector<double> t = map.quantities("translation", Quantity::kLength, 3);
  const std::vector<double> q = map.numbers("quaternion_xyzw", 4);
  const Eigen::Quaterniond rotation(q[3], q[0], q[1], q[2]);
  if (std::abs(rotation.norm() - 1) > kQuaternionTolerance) {
    map.fail("quaternion_xyzw", "is not of unit length (its norm is " + std::to_string(rotation.norm()) + ")");
  }
  map.finish();
  return Eigen::Translation3d(t[0], t[1], t[2]) * rotation.normalized();
}

Rig read_rig(YamlMap root) {
  if (root.integer("rig_version") != kRigFileVersion) {
    root.fail("rig_version", "this program reads version " + std::to_string(kRigFileVersion));
  }
  Rig rig;
  rig.camera = read_rig_camera(root.map("camera"), &rig.capture);
  if (root.has("stereo_baseline")) rig.stereo_baseline_m = read_positive(root, "stereo_baseline", Quantity::kLength);
  if (root.has("T_wrist_camera")) rig.T_wrist_camera = read_pose(root.map("T_wrist_camera"));
  if (root.has("kinematics_noise")) {
    YamlMap noise = root.map("kinematics_noise");
    rig.kinematics_sigma_m = read_positive(noise, "translation", Quantity::kLength);
    rig.kinematics_sigma_rad = read_positive(noise, "rotation", Quantity::kAngle);
    noise.finish();
  }
  YamlMap limits = root.map("limits");
  rig.linear_speed_limit_m_s = read_positive(limits, "linear_speed", Quantity::kSpeed);
  rig.angular_speed_limit_rad_s = read_positive(limits, "angular_speed", Quantity::kAngularSpeed);
  limits.finish();
  if (root.has("drives")) rig.drives = read_drives(root.map("drives"));
  root.finish();
  return rig;
}

}  // namespace

Rig load_rig(const std::filesystem::path& path) {
  Rig rig = read_rig(YamlMap::load(path));
  const auto beside_rig = [&path](DriveRig* drive) {
    if (!drive->eds.empty()) drive->eds = (path.parent_path() / drive->eds).string();
  };
  if (rig.drives) {
    for (JointRig& joint : rig.drives->joints) beside_rig(&joint.drive);
    if (rig.drives->base)
      std::for_each(rig.drives->base->wheels.begin(), rig.drives->base->wheels.end(),
                    [&](DriveRig& wheel) { beside_rig(&wheel); });
  }
  return rig;
}

Rig parse_rig(const std::string& text, const std::string& name) { return read_rig(YamlMap::parse(text, name)); }

RecordingCamera load_recording_camera(const std::filesystem::path& path) {
  YamlMap root = YamlMap::load(path);
  RecordingCamera recording;
  CameraModel& camera = recording.camera;
  if (root.has("width") || root.has("height")) {
    camera.width = read_image_side(root, "width");
    camera.height = read_image_side(root, "height");
  }
  camera.fx = root.number("fx");
  camera.fy = root.number("fy");
  camera.cx = root.number("cx");
  camera.cy = root.number("cy");
  if (root.is_list("distortion")) {
    camera.distortion = Distortion::kRadTan;
    read_coefficients(root, "distortion", {4, 5}, &camera);
  } else if (root.has("distortion") && root.text("distortion") != "none") {
    CoefficientCount count{};
    camera.distortion = read_distortion(root, "distortion", &count);
    read_coefficients(root, "coefficients", count, &camera);
  }
  if (root.has("depth_scale_m")) recording.depth_unit_m = root.number("depth_scale_m");
  if (recording.depth_unit_m <= 0) root.fail("depth_scale_m", "must be positive");
  CameraModel sized = camera;
  if (sized.width == 0) sized.width = sized.height = 1;
  if (std::string why; !sized.valid(&why)) root.fail("fx", why);
  return recording;
}

}  // namespace vantage
