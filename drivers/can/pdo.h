#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "drivers/can/object_table.h"

namespace vantage::can {

/// Process data: to the drive (RPDO) or from it (TPDO), numbers 1 to 4 with the identifiers CiA 301 predefines.
enum class PdoDirection { kToDrive, kFromDrive };

constexpr std::uint32_t pdo_id(PdoDirection direction, int number, std::uint8_t node) {
  return (direction == PdoDirection::kFromDrive ? 0x080U : 0x100U) + 0x100U * static_cast<std::uint32_t>(number) + node;
}
constexpr std::uint16_t pdo_parameters(PdoDirection direction, int number) {
  return static_cast<std::uint16_t>((direction == PdoDirection::kFromDrive ? 0x1800 : 0x1400) + number - 1);
}
constexpr std::uint16_t pdo_mapping(PdoDirection direction, int number) {
  return static_cast<std::uint16_t>((direction == PdoDirection::kFromDrive ? 0x1A00 : 0x1600) + number - 1);
}

inline constexpr std::uint32_t kPdoInvalid = 0x8000'0000;  ///< bit 31 of a PDO's identifier: not in use
inline constexpr std::uint8_t kEverySync = 1;              ///< transmission type: at every SYNC

struct MappedObject {
  ObjectAddress object;
  int bytes = 0;
};

/// One PDO as it is to be.
struct PdoConfig {
  PdoDirection direction = PdoDirection::kToDrive;
  int number = 1;
  std::uint8_t transmission_type = kEverySync;
  std::vector<MappedObject> objects;

  int bytes() const {
    int sum = 0;
    for (const MappedObject& mapped : objects) sum += mapped.bytes;
    return sum;
  }
};

/// An entry of 1600 or 1A00: index, subindex, bits.
constexpr std::uint32_t mapping_entry(const MappedObject& mapped) {
  return static_cast<std::uint32_t>(mapped.object.index) << 16 | static_cast<std::uint32_t>(mapped.object.sub) << 8 |
         static_cast<std::uint32_t>(mapped.bytes) * 8;
}

/// The lowest `bytes` bytes of `value`, little-endian, at `at`.
inline void put_number(std::int64_t value, int bytes, std::uint8_t* at) {
  for (int i = 0; i < bytes; ++i) at[i] = static_cast<std::uint8_t>(static_cast<std::uint64_t>(value) >> (8 * i));
}

/// A little-endian number of up to eight bytes.
inline std::int64_t get_number(std::span<const std::uint8_t> bytes, bool with_sign) {
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < bytes.size() && i < 8; ++i) value |= static_cast<std::uint64_t>(bytes[i]) << (8 * i);
  const std::size_t bits = 8 * bytes.size();
  if (with_sign && bits > 0 && bits < 64 && (value >> (bits - 1) & 1) != 0) value |= ~std::uint64_t{0} << bits;
  return static_cast<std::int64_t>(value);
}

}  // namespace vantage::can
