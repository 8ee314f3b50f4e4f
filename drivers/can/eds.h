#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "drivers/can/object_table.h"

namespace vantage::can {

/// What an electronic data sheet (EDS) or a device configuration file (DCF) says of a drive (CiA 306).
struct Eds {
  std::string vendor_name, product_name;
  std::uint32_t vendor = 0, product = 0;  ///< 0: not told
  int node = 0;                           ///< of a DCF; 0: not told
  ObjectMap objects;
};

/// Reads sections [DeviceInfo], [DeviceComissioning] (as the standard spells it), [1000] and [1018sub1]; others are
/// passed over. Numbers may be decimal, 0x and $NODEID+0x; `node` stands for $NODEID (a DCF's own NodeID comes first).
/// Later values of one key win, as in other readers. CompactSubObj is expanded.
/// \throws InputError "file:line: …": not an INI file, an object without a type, a number that is none, a limit above
/// its counterpart, a default outside its limits.
Eds load_eds(const std::filesystem::path& path, std::uint8_t node = 0);

/// The same from a text; `name` stands for the file in messages.
Eds parse_eds(std::string_view text, const std::string& name, std::uint8_t node = 0);

}  // namespace vantage::can
