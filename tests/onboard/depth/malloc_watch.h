#pragma once

#include <cstddef>

namespace vantage {

/// Counts this thread's calls of malloc while it lives: Eigen's matrices take their memory there, past operator new,
/// which AllocationWatch counts. Linking malloc_watch.cc replaces malloc; not under sanitizers
/// (AllocationWatch::works).
class MallocWatch {
 public:
  MallocWatch();
  ~MallocWatch();
  MallocWatch(const MallocWatch&) = delete;
  MallocWatch& operator=(const MallocWatch&) = delete;

  std::size_t count() const;
};

}  // namespace vantage
