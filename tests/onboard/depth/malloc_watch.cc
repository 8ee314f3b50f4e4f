#include "tests/onboard/depth/malloc_watch.h"

namespace {

thread_local bool watching = false;
thread_local std::size_t calls = 0;

}  // namespace

namespace vantage {

MallocWatch::MallocWatch() {
  calls = 0;
  watching = true;
}
MallocWatch::~MallocWatch() { watching = false; }
std::size_t MallocWatch::count() const { return calls; }

}  // namespace vantage

#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
// glibc's own names of what is replaced.
extern "C" void* __libc_malloc(std::size_t size);              // NOLINT(bugprone-reserved-identifier)
extern "C" void* __libc_calloc(std::size_t n, std::size_t s);  // NOLINT(bugprone-reserved-identifier)
extern "C" void* __libc_realloc(void* memory, std::size_t n);  // NOLINT(bugprone-reserved-identifier)
extern "C" void* malloc(std::size_t size) {
  if (watching) ++calls;
  return __libc_malloc(size);
}
extern "C" void* calloc(std::size_t number, std::size_t size) {
  if (watching) ++calls;
  return __libc_calloc(number, size);
}
extern "C" void* realloc(void* memory, std::size_t size) {
  if (watching) ++calls;
  return __libc_realloc(memory, size);
}
#endif
