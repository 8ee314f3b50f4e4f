#include "calib/rig.h"

#include <fstream>

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
