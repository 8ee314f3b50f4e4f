#include "calib/rig.h"

#include <array>
#include <cmath>
#include <fstream>
#include <sstream>

#include <gtest/gtest.h>

#include "calib/files/input_error.h"
#include "calib/files/strict_yaml.h"

namespace vantage {
namespace {

const char* const kRig = R"(rig_version: 1
camera:
  model: radtan
  width: 640
  height: 480
  focal_length: [500 px, 501 px]
  principal_point: [320 px, 240 px]
  distortion: [-0.3, 0.1, 0.001, 0.002]
stereo_baseline: 10 cm
T_wrist_camera:
  translation: [1 mm, 2 cm, 0.5 m]
  quaternion_xyzw: [0, 0, 0.7071068, 0.7071068]
limits:
  linear_speed: 500 mm/s
  angular_speed: 90 deg/s
)";

class RigFile : public testing::Test {
 protected:
  std::filesystem::path write(const std::string& text) {
    const std::filesystem::path path =
        std::filesystem::path(testing::TempDir()) /
        (std::string(testing::UnitTest::GetInstance()->current_test_info()->name()) + ".yaml");
    std::ofstream(path) << text;
    return path;
  }

  /// The message of loading kRig with the first `from` replaced by `to`.
  std::string fault(const std::string& from, const std::string& to) {
    std::string text = kRig;
    const std::size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    text.replace(at, from.size(), to);
    try {
      load_rig(write(text));
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }
};

TEST_F(RigFile, IsReadInSiUnits) {
  const Rig rig = load_rig(write(kRig));
  EXPECT_EQ(rig.camera.distortion, Distortion::kRadTan);
  EXPECT_EQ(rig.camera.width, 640);
  EXPECT_DOUBLE_EQ(rig.camera.fy, 501);
  EXPECT_DOUBLE_EQ(rig.camera.coefficients[3], 0.002);
  EXPECT_DOUBLE_EQ(rig.stereo_baseline_m, 0.1);
  EXPECT_TRUE(rig.T_wrist_camera.translation().isApprox(Eigen::Vector3d(0.001, 0.02, 0.5), 1e-12));
  EXPECT_TRUE((rig.T_wrist_camera.linear() * Eigen::Vector3d::UnitX()).isApprox(Eigen::Vector3d::UnitY(), 1e-6));
  EXPECT_DOUBLE_EQ(rig.linear_speed_limit_m_s, 0.5);
  EXPECT_NEAR(rig.angular_speed_limit_rad_s, 1.5707963267948966, 1e-12);
}

TEST_F(RigFile, TellsHowFarTheKinematicsAreOff) {
  std::string text = kRig;
  text.insert(text.find("limits"), "kinematics_noise:\n  translation: 3 mm\n  rotation: 0.5 deg\n");
  const Rig rig = load_rig(write(text));
  EXPECT_DOUBLE_EQ(rig.kinematics_sigma_m, 0.003);
  EXPECT_NEAR(rig.kinematics_sigma_rad, 0.0087266, 1e-7);
  EXPECT_DOUBLE_EQ(load_rig(write(kRig)).kinematics_sigma_m, 0.002);
  text.replace(text.find("3 mm"), 4, "0 mm");
  EXPECT_THROW(load_rig(write(text)), InputError);
}

TEST_F(RigFile, NamesFileLineKeyAndMend) {
  const std::string unknown = fault("stereo_baseline", "stereo_base");
  EXPECT_NE(unknown.find(".yaml:9: stereo_base: unknown key"), std::string::npos) << unknown;
  const std::string type = fault("width: 640", "width: wide");
  EXPECT_NE(type.find(".yaml:4: camera.width: expected a whole number, found \"wide\""), std::string::npos) << type;
  const std::string unit = fault("10 cm", "10 deg");
  EXPECT_NE(unit.find(".yaml:9: stereo_baseline: expected a number with its unit, e.g. 0.5 m"), std::string::npos)
      << unit;
  const std::string bare = fault("10 cm", "0.1");
  EXPECT_NE(bare.find("expected a number with its unit"), std::string::npos) << bare;
}

TEST_F(RigFile, RefusesWhatMakesNoSense) {
  EXPECT_NE(fault("10 cm", "-10 cm").find("must be positive"), std::string::npos);
  EXPECT_NE(fault("0.7071068]", "0.5]").find("unit length"), std::string::npos);
  EXPECT_NE(fault("0.001, 0.002", "0.001").find("4 or 5 coefficients, found 3"), std::string::npos);
  EXPECT_NE(fault("500 px", ".nan px").find("focal_length"), std::string::npos);
  EXPECT_NE(fault("500 px", "-500 px").find("positive"), std::string::npos);
  EXPECT_NE(fault("radtan", "fisheye").find("pinhole, radtan or equidistant"), std::string::npos);
  EXPECT_NE(fault("rig_version: 1", "rig_version: 7").find("reads version 1"), std::string::npos);
  EXPECT_NE(fault("height: 480", "width: 480").find("stands twice"), std::string::npos);
  EXPECT_NE(fault("limits:\n", "limits: 3\nelse:\n").find("expected a mapping"), std::string::npos);
  EXPECT_NE(fault("  width: 640\n", "").find("width: is missing"), std::string::npos);
  EXPECT_NE(fault("width: 640", "width: [640").find("not YAML"), std::string::npos);
}

TEST_F(RigFile, TellsHowTheCameraIsSet) {
  std::string text = kRig;
  text.insert(text.find("stereo_baseline"),
              "  frame_rate: 25 Hz\n  exposure: 8 ms\n  gain: 16\n  white_balance_kelvin: 4500\n");
  const Rig rig = load_rig(write(text));
  EXPECT_EQ(rig.capture.rate_hz, 25);
  EXPECT_DOUBLE_EQ(*rig.capture.exposure_s, 0.008);
  EXPECT_EQ(rig.capture.gain, 16);
  EXPECT_EQ(rig.capture.white_balance_k, 4500);
  const Rig plain = load_rig(write(kRig));
  EXPECT_EQ(plain.capture.rate_hz, 30);
  EXPECT_FALSE(plain.capture.exposure_s);
}

TEST_F(RigFile, DrivesAreReadInSiUnitsWithTheirScale) {
  const DrivesRig drives = *load_rig(VANTAGE_SOURCE_DIR "/calib/rigs/youbot.yaml").drives;
  ASSERT_EQ(drives.axes(), 9U);
  // hardware-facts: increments a joint's revolution.
  constexpr std::array kTurn{624'000.0, 624'000.0, 400'000.0, 284'000.0, 284'000.0};
  for (std::size_t i = 0; i < 5; ++i) {
    EXPECT_NEAR(drives.joints[i].drive.increments_per_rad() * 2 * M_PI, kTurn[i], 1e-6) << i;
  }
  EXPECT_NEAR(drives.joints[1].upper_rad, M_PI / 2, 1e-12);
  EXPECT_EQ(drives.joints[0].homing_method, 18);  // its switch is at the upper end, where increments grow
  EXPECT_EQ(drives.joints[1].homing_method, 17);
  EXPECT_NEAR(drives.base->wheels[0].increments_per_rad() * 2 * M_PI, -4000 * 9405.0 / 364, 1e-6);
  EXPECT_EQ(drives.cycle, std::chrono::milliseconds(10));
}

TEST_F(RigFile, DrivesThatMakeNoSenseAreNamed) {
  std::string text;
  {
    std::ostringstream all;
    all << std::ifstream(VANTAGE_SOURCE_DIR "/calib/rigs/youbot.yaml").rdbuf();
    text = all.str();
  }
  const auto fault_of = [&text](const std::string& from, const std::string& to) -> std::string {
    std::string changed = text;
    const std::size_t at = changed.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    changed.replace(at, from.size(), to);
    try {
      parse_rig(changed, "text");
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(fault_of("node: 1", "node: 1"), "");
  EXPECT_NE(fault_of("node: 2", "node: 1").find("another drive has it already"), std::string::npos);
  EXPECT_NE(fault_of("node: 1", "node: 127").find("expected 1 to 126"), std::string::npos);
  EXPECT_NE(fault_of("gear: [156, 1]", "gear: [0, 1]").find("both positive"), std::string::npos);
  EXPECT_NE(fault_of("sign: 1", "sign: 0").find("expected 1 or -1"), std::string::npos);
  EXPECT_NE(fault_of("zero: 170 deg", "zero: 0 deg").find("far from both ends"), std::string::npos);
  EXPECT_NE(fault_of("[-169 deg, 169 deg]", "[169 deg, -169 deg]").find("[lower, upper]"), std::string::npos);
  EXPECT_NE(fault_of("stop_after: 100 ms", "stop_after: 30 ms").find("at least two heartbeats"), std::string::npos);
  EXPECT_NE(fault_of("300 deg/s2", "300 deg/s").find("expected a number with its unit"), std::string::npos);
  EXPECT_NE(fault_of("cycle: 10 ms", "cycle: 10.5 ms").find("whole milliseconds"), std::string::npos);
}

TEST_F(RigFile, AbsentFileIsNamed) {
  try {
    load_rig("/nonexistent/rig.yaml");
    FAIL();
  } catch (const InputError& error) {
    EXPECT_STREQ(error.what(), "/nonexistent/rig.yaml: no such file, or it can't be read");
  }
}

TEST_F(RigFile, ShippedRigsLoad) {
  int files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(VANTAGE_SOURCE_DIR "/calib/rigs")) {
    if (entry.path().extension() != ".yaml") continue;  // drives' data sheets
    EXPECT_NO_THROW(load_rig(entry.path())) << entry.path();
    ++files;
  }
  EXPECT_GT(files, 0);
}

TEST_F(RigFile, RecordingCameraTakesTheUsualForms) {
  const RecordingCamera plain =
      load_recording_camera(write("fx: 518.0\nfy: 517\ncx: 320\ncy: 240\ndistortion: none\n"));
  EXPECT_EQ(plain.camera.width, 0);
  EXPECT_EQ(plain.camera.distortion, Distortion::kNone);
  EXPECT_DOUBLE_EQ(plain.depth_unit_m, 0.001);
  const RecordingCamera list = load_recording_camera(
      write("width: 640\nheight: 480\nfx: 518.0\nfy: 517\ncx: 320\ncy: 240\ndistortion: [0.1, 0, 0, 0]\n"
            "depth_scale_m: 0.0002\n"));
  EXPECT_EQ(list.camera.distortion, Distortion::kRadTan);
  EXPECT_DOUBLE_EQ(list.camera.coefficients[0], 0.1);
  EXPECT_DOUBLE_EQ(list.depth_unit_m, 0.0002);
  const RecordingCamera fisheye = load_recording_camera(
      write("fx: 518.0\nfy: 517\ncx: 320\ncy: 240\ndistortion: equidistant\ncoefficients: [0.1, 0, 0, 0]\n"));
  EXPECT_EQ(fisheye.camera.distortion, Distortion::kEquidistant);
  EXPECT_THROW(load_recording_camera(write("fx: 0\nfy: 1\ncx: 0\ncy: 0\n")), InputError);
}

TEST(YamlQuantity, IsReadBackToTheSameBits) {
  for (const double value : {0.1, 1.0 / 3, 1e-9, 123456.789}) {
    YamlMap map = YamlMap::parse("length: " + yaml_quantity(value, Quantity::kLength), "text");
    EXPECT_EQ(map.quantity("length", Quantity::kLength), value);
  }
}

}  // namespace
}  // namespace vantage
