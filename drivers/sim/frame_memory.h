#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "drivers/sim/unix_socket.h"

namespace vantage::sim {

/// Memory shared between simulator and client (a memfd): `slots` pairs of images. Its size is sealed, so that a client
/// that maps it can never be cut off; only this mapping can write.
class FrameMemory {
 public:
  /// \throws std::runtime_error when the system has no memory for it.
  FrameMemory(int slots, std::size_t image_bytes);
  ~FrameMemory();
  FrameMemory(const FrameMemory&) = delete;
  FrameMemory& operator=(const FrameMemory&) = delete;

  int fd() const { return fd_.get(); }
  std::size_t slot_bytes() const { return 2 * right_offset_; }
  std::size_t right_offset() const { return right_offset_; }
  std::span<std::uint8_t> left(std::size_t slot) { return {base_ + slot * slot_bytes(), image_bytes_}; }
  std::span<std::uint8_t> right(std::size_t slot) {
    return {base_ + slot * slot_bytes() + right_offset_, image_bytes_};
  }

 private:
  std::size_t image_bytes_, right_offset_, total_;
  FileDescriptor fd_;
  std::uint8_t* base_ = nullptr;
};

}  // namespace vantage::sim
