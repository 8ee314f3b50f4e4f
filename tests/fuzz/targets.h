#pragma once

#include <cstdint>
#include <span>

namespace vantage::fuzz {

// Each takes any bytes and must neither crash nor hang, nor break the laws that it checks by abort().

using Bytes = std::span<const std::uint8_t>;

/// Frames as the kernel or a simulated bus hands them over, 16 bytes each.
void can_frame(Bytes input);
/// Frames of eight bytes: as answers to the master's transfers, and as requests to a simulated drive.
void sdo(Bytes input);
/// An electronic data sheet.
void eds(Bytes input);
/// A rig file.
void rig(Bytes input);
/// Datagrams of LCM, each behind its length (16 bits, the low byte first): decoded as every type, and heard by both
/// ends of the link.
void datagram(Bytes input);

}  // namespace vantage::fuzz
