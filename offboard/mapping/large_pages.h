#pragma once

#include <cstddef>
#include <new>

#include <sys/mman.h>

namespace vantage {

/// Allocator that asks for large pages (Linux, where "madvise" or "always" is set) for large arrays: rays read codes
/// all over tens of megabytes, and with 4 KiB pages most of those reads miss the translation buffers first.
template <typename T>
struct LargePageAllocator {
  using value_type = T;
  static constexpr std::size_t kPage = std::size_t{2} << 20;

  LargePageAllocator() = default;
  template <typename U>
  explicit LargePageAllocator(const LargePageAllocator<U>& /*other*/) {}

  T* allocate(std::size_t count) {
    const std::size_t bytes = count * sizeof(T);
    if (bytes < kPage) return static_cast<T*>(::operator new(bytes));
    const std::size_t whole = (bytes + kPage - 1) / kPage * kPage;
    void* memory = ::operator new (whole, std::align_val_t{kPage});
    ::madvise(memory, whole, MADV_HUGEPAGE);  // a hint: failure costs speed alone
    return static_cast<T*>(memory);
  }
  void deallocate(T* memory, std::size_t count) {
    if (count * sizeof(T) < kPage) {
      ::operator delete(memory);
    } else {
      ::operator delete (memory, std::align_val_t{kPage});
    }
  }
  bool operator==(const LargePageAllocator& /*other*/) const { return true; }
};

}  // namespace vantage
