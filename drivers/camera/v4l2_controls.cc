#include "drivers/camera/v4l2_controls.h"

#include <algorithm>
#include <cmath>

#include <linux/videodev2.h>

#include "drivers/camera/v4l2_device.h"

namespace vantage {
namespace {

constexpr double kExposureUnit_s = 1e-4;  // of V4L2_CID_EXPOSURE_ABSOLUTE

/// Sets a control, cut to its range; what the camera keeps otherwise is noted. False when it has none.
bool set_control(ControlPort& camera, std::uint32_t control, const char* name, int value, FixedSettings* fixed) {
  const std::optional<ControlPort::Range> range = camera.range(control);
  if (!range) return false;
  camera.set(control, std::clamp(value, range->least, range->most));
  const std::optional<int> kept = camera.get(control);
  if (kept != value) {
    fixed->notes.push_back(std::string(name) + ": asked for " + std::to_string(value) + ", the camera keeps " +
                           (kept ? std::to_string(*kept) : "nothing") + " (" + std::to_string(range->least) + " to " +
                           std::to_string(range->most) + ")");
  }
  return true;
}

/// The same for a value that a person asked for: that the camera has no such control is noted as well.
void set_wanted(ControlPort& camera, std::uint32_t control, const char* name, std::optional<int> value,
                FixedSettings* fixed) {
  if (value && !set_control(camera, control, name, *value, fixed)) {
    fixed->notes.push_back(std::string("the camera has no control for ") + name);
  }
}

}  // namespace

std::optional<ControlPort::Range> V4l2Controls::range(std::uint32_t control) {
  v4l2_queryctrl query{};
  query.id = control;
  if (retried_ioctl(fd_, VIDIOC_QUERYCTRL, &query) != 0 || (query.flags & V4L2_CTRL_FLAG_DISABLED) != 0) return {};
  return Range{query.minimum, query.maximum};
}

std::optional<int> V4l2Controls::get(std::uint32_t control) {
  v4l2_control value{};
  value.id = control;
  if (!range(control) || retried_ioctl(fd_, VIDIOC_G_CTRL, &value) != 0) return {};
  return value.value;
}

void V4l2Controls::set(std::uint32_t control, int value) {
  v4l2_control order{};
  order.id = control;
  order.value = value;
  retried_ioctl(fd_, VIDIOC_S_CTRL, &order);
}

FixedSettings fix_settings(ControlPort& camera, const CameraSettings& settings) {
  FixedSettings fixed;
  // First the automatics, which would take the values back.
  set_control(camera, V4L2_CID_EXPOSURE_AUTO_PRIORITY, "frame rate that follows the light", 0, &fixed);
  set_control(camera, V4L2_CID_EXPOSURE_AUTO, "manual exposure", V4L2_EXPOSURE_MANUAL, &fixed);
  set_control(camera, V4L2_CID_AUTOGAIN, "automatic gain", 0, &fixed);
  set_control(camera, V4L2_CID_AUTO_WHITE_BALANCE, "automatic white balance", 0, &fixed);

  std::optional<int> exposure;
  if (settings.exposure_s) exposure = static_cast<int>(std::lround(*settings.exposure_s / kExposureUnit_s));
  set_wanted(camera, V4L2_CID_EXPOSURE_ABSOLUTE, "exposure", exposure, &fixed);
  fixed.exposure_s = camera.get(V4L2_CID_EXPOSURE_ABSOLUTE).value_or(0) * kExposureUnit_s;

  // Sensors have an analogue gain, webcams a plain one.
  const bool analogue = camera.range(V4L2_CID_ANALOGUE_GAIN).has_value();
  const std::uint32_t gain = analogue ? std::uint32_t{V4L2_CID_ANALOGUE_GAIN} : std::uint32_t{V4L2_CID_GAIN};
  set_wanted(camera, gain, "gain", settings.gain, &fixed);
  fixed.gain = camera.get(gain).value_or(0);

  set_wanted(camera, V4L2_CID_WHITE_BALANCE_TEMPERATURE, "white balance", settings.white_balance_k, &fixed);
  fixed.white_balance_k = camera.get(V4L2_CID_WHITE_BALANCE_TEMPERATURE).value_or(0);
  return fixed;
}

}  // namespace vantage
