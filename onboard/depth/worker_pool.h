#pragma once

#include <atomic>
#include <condition_variable>
#include <mutex>
#include <thread>
#include <vector>

namespace vantage {

/// Threads that wait for work cut into numbered chunks. Nothing is allocated after construction.
class WorkerPool {
 public:
  /// `threads` take part in the work, the caller of `run` among them; 0: as many as the machine has.
  explicit WorkerPool(int threads = 0);
  ~WorkerPool();
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

  int threads() const { return static_cast<int>(others_.size()) + 1; }

  /// Calls `work(context, chunk)` for every chunk in [0, chunks), each once, by whichever thread is free; returns when
  /// all are done. `work` must not throw. One caller at a time.
  void run(int chunks, void (*work)(void* context, int chunk), void* context);

  /// The same for anything that can be called with a chunk's number.
  template <typename Work>
  void run(int chunks, Work&& work) {
    run(
        chunks, [](void* context, int chunk) { (*static_cast<std::remove_reference_t<Work>*>(context))(chunk); },
        &work);
  }

 private:
  void wait_for_work();
  void take_chunks();

  std::vector<std::thread> others_;
  std::mutex mutex_;  ///< guards round_, busy_, stop_ and, between rounds, the work
  std::condition_variable started_, finished_;
  std::uint64_t round_ = 0;
  int busy_ = 0;
  bool stop_ = false;

  void (*work_)(void*, int) = nullptr;
  void* context_ = nullptr;
  int chunks_ = 0;
  std::atomic<int> next_{0};
};

}  // namespace vantage
