#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>

namespace vantage::can {

/// Where an object of a drive lies: "607A" or "60C2:1".
struct ObjectAddress {
  std::uint16_t index = 0;
  std::uint8_t sub = 0;

  friend constexpr bool operator==(const ObjectAddress& a, const ObjectAddress& b) {
    return a.index == b.index && a.sub == b.sub;
  }
  friend constexpr bool operator<(const ObjectAddress& a, const ObjectAddress& b) {
    return a.index != b.index ? a.index < b.index : a.sub < b.sub;
  }
};

/// The codes of CiA 301, as an EDS writes them after "DataType=0x".
enum class DataType : std::uint16_t {
  kBoolean = 0x01,
  kInteger8 = 0x02,
  kInteger16 = 0x03,
  kInteger32 = 0x04,
  kUnsigned8 = 0x05,
  kUnsigned16 = 0x06,
  kUnsigned32 = 0x07,
  kVisibleString = 0x09,
  kOctetString = 0x0A,
  kDomain = 0x0F
};

/// Bytes of a number of this type; 0 for strings and domains, whose length is their own.
int size_of(DataType type);
bool is_signed(DataType type);

/// What is known of one object.
struct ObjectEntry {
  std::string name;
  DataType type = DataType::kUnsigned32;
  bool writable = false;
  std::optional<std::int64_t> low_limit, high_limit;
  std::optional<std::int64_t> value;  ///< a DCF's ParameterValue, else an EDS's DefaultValue
};

/// Objects by address.
using ObjectMap = std::map<ObjectAddress, ObjectEntry>;

/// The objects of CiA 301 and CiA 402 that Vantage uses, with the types that the profiles give them. The only place
/// that holds them: a drive's EDS may correct it (`corrected_by`).
const ObjectMap& profile_objects();

/// `base` with every entry of `eds` in the place of its own.
ObjectMap corrected_by(const ObjectMap& base, const ObjectMap& eds);

/// "607A (target position)", "60C2:1 (interpolation time period)"; without a name where it is not known.
std::string to_text(const ObjectAddress& address, const ObjectMap& objects = profile_objects());

namespace objects {

inline constexpr ObjectAddress kDeviceType{0x1000, 0};
inline constexpr ObjectAddress kErrorRegister{0x1001, 0};
inline constexpr ObjectAddress kErrorHistory{0x1003, 1};
inline constexpr ObjectAddress kDeviceName{0x1008, 0};
inline constexpr ObjectAddress kMasterHeartbeat{0x1016, 1};  ///< node << 16 | ms
inline constexpr ObjectAddress kProducerHeartbeat{0x1017, 0};
inline constexpr ObjectAddress kVendor{0x1018, 1}, kProduct{0x1018, 2}, kRevision{0x1018, 3}, kSerial{0x1018, 4};
inline constexpr ObjectAddress kConnectionLossReaction{0x6007, 0};  ///< 3: quick stop
inline constexpr ObjectAddress kErrorCode{0x603F, 0};
inline constexpr ObjectAddress kControlword{0x6040, 0}, kStatusword{0x6041, 0};
inline constexpr ObjectAddress kQuickStopReaction{0x605A, 0};
inline constexpr ObjectAddress kMode{0x6060, 0}, kModeDisplay{0x6061, 0};
inline constexpr ObjectAddress kActualPosition{0x6064, 0};
inline constexpr ObjectAddress kFollowingErrorWindow{0x6065, 0}, kFollowingErrorTime{0x6066, 0};
inline constexpr ObjectAddress kActualVelocity{0x606C, 0};
inline constexpr ObjectAddress kTargetPosition{0x607A, 0};
inline constexpr ObjectAddress kHomeOffset{0x607C, 0};
inline constexpr ObjectAddress kLowestPosition{0x607D, 1}, kHighestPosition{0x607D, 2};
inline constexpr ObjectAddress kHighestSpeed{0x607F, 0};
inline constexpr ObjectAddress kProfileSpeed{0x6081, 0};
inline constexpr ObjectAddress kProfileAcceleration{0x6083, 0}, kProfileDeceleration{0x6084, 0};
inline constexpr ObjectAddress kQuickStopDeceleration{0x6085, 0};
inline constexpr ObjectAddress kEncoderIncrements{0x608F, 1}, kEncoderTurns{0x608F, 2};
inline constexpr ObjectAddress kGearMotorTurns{0x6091, 1}, kGearShaftTurns{0x6091, 2};
inline constexpr ObjectAddress kHomingMethod{0x6098, 0};
inline constexpr ObjectAddress kHomingSwitchSpeed{0x6099, 1}, kHomingZeroSpeed{0x6099, 2};
inline constexpr ObjectAddress kHomingAcceleration{0x609A, 0};
inline constexpr ObjectAddress kCyclePeriod{0x60C2, 1}, kCycleExponent{0x60C2, 2};
inline constexpr ObjectAddress kFollowingError{0x60F4, 0};
inline constexpr ObjectAddress kTargetVelocity{0x60FF, 0};
inline constexpr ObjectAddress kSupportedModes{0x6502, 0};

}  // namespace objects

}  // namespace vantage::can
