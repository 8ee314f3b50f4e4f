#include "tests/allocation_watch.h"

#include <cstdlib>
#include <new>

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define VANTAGE_WATCHES_ALLOCATIONS 0
#else
#define VANTAGE_WATCHES_ALLOCATIONS 1
#endif

namespace vantage {
namespace {

thread_local bool watching = false;
thread_local std::size_t allocations = 0;

}  // namespace

void count_allocation() {
  if (watching) ++allocations;
}

AllocationWatch::AllocationWatch() {
  allocations = 0;
  watching = true;
}
AllocationWatch::~AllocationWatch() { watching = false; }
std::size_t AllocationWatch::count() const { return allocations; }
bool AllocationWatch::works() { return VANTAGE_WATCHES_ALLOCATIONS != 0; }

}  // namespace vantage

#if VANTAGE_WATCHES_ALLOCATIONS
void* operator new(std::size_t size) {
  vantage::count_allocation();
  void* const memory = std::malloc(size == 0 ? 1 : size);
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
#endif
