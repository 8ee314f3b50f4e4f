#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace vantage {

/// What is to be fixed on a camera, so that frames can be compared. Without a value the present one stays, but the
/// camera's own adjusting is switched off all the same.
struct CameraSettings {
  std::optional<double> exposure_s;
  std::optional<int> gain;             ///< in the camera's own steps
  std::optional<int> white_balance_k;  ///< kelvin
};

/// What the camera keeps, read back after setting.
struct FixedSettings {
  double exposure_s = 0;           ///< 0: the camera does not tell
  int gain = 0;                    ///< 0: the camera does not tell
  int white_balance_k = 0;         ///< 0: the camera does not tell
  std::vector<std::string> notes;  ///< what the camera has no control for, or keeps otherwise than asked
};

/// A camera's controls (V4L2_CID_...), one number each.
class ControlPort {
 public:
  struct Range {
    int least = 0, most = 0;
  };
  virtual ~ControlPort() = default;

  /// What the control takes; nothing when the camera has no such control, or has disabled it.
  virtual std::optional<Range> range(std::uint32_t control) = 0;
  virtual std::optional<int> get(std::uint32_t control) = 0;
  /// A camera may refuse, or keep another value: `get` tells.
  virtual void set(std::uint32_t control, int value) = 0;
};

/// The controls of an opened device.
class V4l2Controls final : public ControlPort {
 public:
  explicit V4l2Controls(int fd) : fd_(fd) {}
  std::optional<Range> range(std::uint32_t control) override;
  std::optional<int> get(std::uint32_t control) override;
  void set(std::uint32_t control, int value) override;

 private:
  int fd_;
};

/// Switches automatic exposure, gain, white balance and a frame rate that follows the light off, sets the values and
/// reads all of it back.
FixedSettings fix_settings(ControlPort& camera, const CameraSettings& settings);

}  // namespace vantage
