#pragma once

#include <cstdint>

namespace vantage::can {

// Network management of CiA 301: who may talk, and who lives.

inline constexpr std::uint32_t kNmtId = 0x000, kSyncId = 0x080;
inline constexpr std::uint8_t kLastNode = 127;
constexpr std::uint32_t heartbeat_id(std::uint8_t node) { return 0x700U + node; }

enum class NmtCommand : std::uint8_t {
  kStart = 0x01,
  kStop = 0x02,
  kPreOperational = 0x80,
  kResetNode = 0x81,
  kResetCommunication = 0x82
};

enum class NmtState : std::uint8_t { kBoot = 0x00, kStopped = 0x04, kOperational = 0x05, kPreOperational = 0x7F };

constexpr const char* to_text(NmtState state) {
  switch (state) {
    case NmtState::kBoot:
      return "booting";
    case NmtState::kStopped:
      return "stopped";
    case NmtState::kOperational:
      return "operational";
    case NmtState::kPreOperational:
      return "pre-operational";
  }
  return "in an unknown state";
}

}  // namespace vantage::can
