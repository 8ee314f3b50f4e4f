#pragma once

#include <atomic>
#include <cstddef>
#include <thread>
#include <vector>

namespace vantage {

/// Runs task(0) ... task(count - 1), each once, on so many threads, the caller's among them. Tasks must not throw and
/// write to places of their own.
template <typename Task>
void run_tasks(std::size_t count, int threads, Task&& task) {
  std::atomic<std::size_t> next{0};
  const auto work = [&] {
    for (std::size_t i = next++; i < count; i = next++) task(i);
  };
  std::vector<std::jthread> others;
  for (int i = 1; i < threads && static_cast<std::size_t>(i) < count; ++i) others.emplace_back(work);
  work();
}

}  // namespace vantage
