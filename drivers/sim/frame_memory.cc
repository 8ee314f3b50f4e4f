#include "drivers/sim/frame_memory.h"

#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <string>

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

namespace vantage::sim {
namespace {

/// Images start on a boundary of a cache line.
constexpr std::size_t kAlignment = 64;

}  // namespace

FrameMemory::FrameMemory(int slots, std::size_t image_bytes)
    : image_bytes_(image_bytes),
      right_offset_((image_bytes + kAlignment - 1) / kAlignment * kAlignment),
      total_(static_cast<std::size_t>(slots) * 2 * right_offset_),
      fd_(::memfd_create("vantage-sim frames", MFD_CLOEXEC | MFD_ALLOW_SEALING)) {
  if (fd_.valid() && ::ftruncate(fd_.get(), static_cast<off_t>(total_)) == 0) {
    void* mapped = ::mmap(nullptr, total_, PROT_READ | PROT_WRITE, MAP_SHARED, fd_.get(), 0);
    if (mapped != MAP_FAILED) base_ = static_cast<std::uint8_t*>(mapped);
  }
  // Later mappings, the client's, are read-only: F_SEAL_FUTURE_WRITE spares the one made above.
  if (base_ == nullptr ||
      ::fcntl(fd_.get(), F_ADD_SEALS, F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_FUTURE_WRITE | F_SEAL_SEAL) != 0) {
    const int error = errno;
    if (base_ != nullptr) ::munmap(base_, total_);
    throw std::runtime_error(std::string("no shared memory for the frames: ") + std::strerror(error));
  }
}

FrameMemory::~FrameMemory() { ::munmap(base_, total_); }

}  // namespace vantage::sim
