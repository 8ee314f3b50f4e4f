#pragma once

#include <cstddef>

namespace vantage {

/// Counts what this thread takes from the heap while it lives. Linking allocation_watch.cc replaces operator new.
class AllocationWatch {
 public:
  AllocationWatch();
  ~AllocationWatch();
  AllocationWatch(const AllocationWatch&) = delete;
  AllocationWatch& operator=(const AllocationWatch&) = delete;

  std::size_t count() const;
  /// False under sanitizers, which bring an operator new of their own.
  static bool works();
};

}  // namespace vantage
