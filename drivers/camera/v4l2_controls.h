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

/// Switches automatic exposure, gain, white balance and a frame rate that follows the light off, sets the values and
/// reads all of it back.
FixedSettings fix_settings(int fd, const CameraSettings& settings);

}  // namespace vantage
