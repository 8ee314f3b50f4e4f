#include "drivers/camera/v4l2_controls.h"

#include <algorithm>
#include <cmath>

#include <linux/videodev2.h>

#include "drivers/camera/v4l2_device.h"

namespace vantage {
namespace {

constexpr double kExposureUnit_s = 1e-4;  // of V4L2_CID_EXPOSURE_ABSOLUTE

class Controls {
 public:
  Controls(int fd, std::vector<std::string>* notes) : fd_(fd), notes_(notes) {}

  bool has(std::uint32_t id) const { return query(id).has_value(); }

  std::optional<int> get(std::uint32_t id) const {
    v4l2_control control{};
    control.id = id;
    if (!has(id) || retried_ioctl(fd_, VIDIOC_G_CTRL, &control) != 0) return {};
    return control.value;
  }

  /// Sets a control that may be absent; its value afterwards.
  std::optional<int> set(std::uint32_t id, const char* name, int value) {
    const std::optional<v4l2_queryctrl> range = query(id);
    if (!range) return {};
    v4l2_control control{};
    control.id = id;
    control.value = std::clamp(value, range->minimum, range->maximum);
    retried_ioctl(fd_, VIDIOC_S_CTRL, &control);
    const std::optional<int> kept = get(id);
    if (kept != value) {
      notes_->push_back(std::string(name) + ": asked for " + std::to_string(value) + ", the camera keeps " +
                        (kept ? std::to_string(*kept) : "nothing") + " (" + std::to_string(range->minimum) + " to " +
                        std::to_string(range->maximum) + ")");
    }
    return kept;
  }

  void lacks(const char* name) { notes_->push_back(std::string("the camera has no control for ") + name); }

 private:
  std::optional<v4l2_queryctrl> query(std::uint32_t id) const {
    v4l2_queryctrl query{};
    query.id = id;
    if (retried_ioctl(fd_, VIDIOC_QUERYCTRL, &query) != 0 || (query.flags & V4L2_CTRL_FLAG_DISABLED) != 0) return {};
    return query;
  }

  int fd_;
  std::vector<std::string>* notes_;
};

}  // namespace

FixedSettings fix_settings(int fd, const CameraSettings& settings) {
  FixedSettings fixed;
  Controls controls(fd, &fixed.notes);
  controls.set(V4L2_CID_EXPOSURE_AUTO_PRIORITY, "frame rate that follows the light", 0);
  controls.set(V4L2_CID_EXPOSURE_AUTO, "manual exposure", V4L2_EXPOSURE_MANUAL);
  controls.set(V4L2_CID_AUTOGAIN, "automatic gain", 0);
  controls.set(V4L2_CID_AUTO_WHITE_BALANCE, "automatic white balance", 0);

  if (settings.exposure_s) {
    const int units = static_cast<int>(std::lround(*settings.exposure_s / kExposureUnit_s));
    if (!controls.set(V4L2_CID_EXPOSURE_ABSOLUTE, "exposure", units)) controls.lacks("exposure");
  }
  if (const auto units = controls.get(V4L2_CID_EXPOSURE_ABSOLUTE)) fixed.exposure_s = *units * kExposureUnit_s;

  // Sensors have an analogue gain, webcams a plain one.
  const std::uint32_t gain =
      controls.has(V4L2_CID_ANALOGUE_GAIN) ? std::uint32_t{V4L2_CID_ANALOGUE_GAIN} : std::uint32_t{V4L2_CID_GAIN};
  if (settings.gain && !controls.set(gain, "gain", *settings.gain)) controls.lacks("gain");
  fixed.gain = controls.get(gain).value_or(0);

  if (settings.white_balance_k &&
      !controls.set(V4L2_CID_WHITE_BALANCE_TEMPERATURE, "white balance", *settings.white_balance_k)) {
    controls.lacks("white balance");
  }
  fixed.white_balance_k = controls.get(V4L2_CID_WHITE_BALANCE_TEMPERATURE).value_or(0);
  return fixed;
}

}  // namespace vantage
