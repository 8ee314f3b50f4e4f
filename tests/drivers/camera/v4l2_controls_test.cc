#include "drivers/camera/v4l2_controls.h"

#include <map>
#include <vector>

#include <gtest/gtest.h>
#include <linux/videodev2.h>

namespace vantage {
namespace {

/// A webcam: its exposure and white balance can only be set while their automatics are off, as with UVC.
class Webcam final : public ControlPort {
 public:
  std::optional<Range> range(std::uint32_t control) override {
    const auto found = controls_.find(control);
    return found == controls_.end() ? std::nullopt : std::optional(found->second.range);
  }
  std::optional<int> get(std::uint32_t control) override {
    const auto found = controls_.find(control);
    return found == controls_.end() ? std::nullopt : std::optional(found->second.value);
  }
  void set(std::uint32_t control, int value) override {
    const auto found = controls_.find(control);
    ASSERT_NE(found, controls_.end()) << "sets what the camera does not have";
    ASSERT_GE(value, found->second.range.least);
    ASSERT_LE(value, found->second.range.most);
    if (control == V4L2_CID_EXPOSURE_ABSOLUTE && controls_.at(V4L2_CID_EXPOSURE_AUTO).value != V4L2_EXPOSURE_MANUAL) {
      return;
    }
    if (control == V4L2_CID_WHITE_BALANCE_TEMPERATURE && controls_.at(V4L2_CID_AUTO_WHITE_BALANCE).value != 0) return;
    found->second.value = control == V4L2_CID_GAIN ? value / 4 * 4 : value;  // it has only every fourth gain
  }
  void remove(std::uint32_t control) { controls_.erase(control); }

 private:
  struct Control {
    Range range;
    int value;
  };
  std::map<std::uint32_t, Control> controls_{
      {V4L2_CID_EXPOSURE_AUTO_PRIORITY, {{0, 1}, 1}},
      {V4L2_CID_EXPOSURE_AUTO, {{0, 3}, V4L2_EXPOSURE_APERTURE_PRIORITY}},
      {V4L2_CID_EXPOSURE_ABSOLUTE, {{1, 5000}, 157}},
      {V4L2_CID_GAIN, {{0, 255}, 64}},
      {V4L2_CID_AUTO_WHITE_BALANCE, {{0, 1}, 1}},
      {V4L2_CID_WHITE_BALANCE_TEMPERATURE, {{2800, 6500}, 4000}},
  };
};

TEST(CameraSettings, AreSetAfterTheAutomaticsAreOffAndReadBack) {
  Webcam camera;
  const FixedSettings fixed = fix_settings(camera, {0.008, 100, 5200});
  EXPECT_DOUBLE_EQ(fixed.exposure_s, 0.008);
  EXPECT_EQ(fixed.gain, 100);
  EXPECT_EQ(fixed.white_balance_k, 5200);
  EXPECT_TRUE(fixed.notes.empty());
  EXPECT_EQ(camera.get(V4L2_CID_EXPOSURE_AUTO_PRIORITY), 0);
  EXPECT_EQ(camera.get(V4L2_CID_EXPOSURE_AUTO), V4L2_EXPOSURE_MANUAL);
}

TEST(CameraSettings, WithoutAWishThePresentValuesStayAndAreTold) {
  Webcam camera;
  const FixedSettings fixed = fix_settings(camera, {});
  EXPECT_DOUBLE_EQ(fixed.exposure_s, 0.0157);
  EXPECT_EQ(fixed.gain, 64);
  EXPECT_EQ(fixed.white_balance_k, 4000);
  EXPECT_EQ(camera.get(V4L2_CID_EXPOSURE_AUTO), V4L2_EXPOSURE_MANUAL);
  EXPECT_EQ(camera.get(V4L2_CID_AUTO_WHITE_BALANCE), 0);
}

TEST(CameraSettings, WhatTheCameraKeepsOtherwiseIsTold) {
  Webcam camera;
  const FixedSettings fixed = fix_settings(camera, {2.0, 102, {}});
  EXPECT_DOUBLE_EQ(fixed.exposure_s, 0.5);
  EXPECT_EQ(fixed.gain, 100);
  EXPECT_EQ(fixed.notes, (std::vector<std::string>{"exposure: asked for 20000, the camera keeps 5000 (1 to 5000)",
                                                   "gain: asked for 102, the camera keeps 100 (0 to 255)"}));
}

TEST(CameraSettings, WhatTheCameraLacksIsTold) {
  Webcam camera;
  camera.remove(V4L2_CID_EXPOSURE_ABSOLUTE);
  camera.remove(V4L2_CID_WHITE_BALANCE_TEMPERATURE);
  const FixedSettings fixed = fix_settings(camera, {0.01, {}, 5000});
  EXPECT_EQ(fixed.exposure_s, 0);
  EXPECT_EQ(fixed.notes, (std::vector<std::string>{"the camera has no control for exposure",
                                                   "the camera has no control for white balance"}));
}

}  // namespace
}  // namespace vantage
