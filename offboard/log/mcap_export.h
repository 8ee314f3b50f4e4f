#pragma once

#include <cstdint>
#include <filesystem>

namespace vantage {

struct McapExport {
  std::uint64_t events = 0;    ///< of the log, each one message on the topic of its channel's name
  std::uint64_t faulty = 0;    ///< events of ours that do not hold, and are not in the file or without their images
  std::uint64_t messages = 0;  ///< in the file, with the images and poses made from events
  std::size_t chunks = 0;
};

/// Writes a log as MCAP, whole or not at all. docs/log.md says what is on which topic.
/// \throws InputError when the log is none or damaged, or the file can't be written.
McapExport export_mcap(const std::filesystem::path& log, const std::filesystem::path& mcap);

}  // namespace vantage
