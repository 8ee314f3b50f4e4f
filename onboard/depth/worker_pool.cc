#include "onboard/depth/worker_pool.h"

#include <algorithm>

namespace vantage {

WorkerPool::WorkerPool(int threads) {
  if (threads <= 0) threads = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  others_.reserve(static_cast<std::size_t>(threads - 1));
  for (int i = 1; i < threads; ++i) others_.emplace_back([this] { wait_for_work(); });
}

WorkerPool::~WorkerPool() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  started_.notify_all();
  for (std::thread& other : others_) other.join();
}

void WorkerPool::run(int chunks, void (*work)(void*, int), void* context) {
  {
    const std::lock_guard lock(mutex_);
    work_ = work;
    context_ = context;
    chunks_ = chunks;
    next_ = 0;
    busy_ = static_cast<int>(others_.size());
    ++round_;
  }
  started_.notify_all();
  take_chunks();
  std::unique_lock lock(mutex_);
  finished_.wait(lock, [this] { return busy_ == 0; });
}

void WorkerPool::wait_for_work() {
  std::uint64_t seen = 0;
  while (true) {
    {
      std::unique_lock lock(mutex_);
      started_.wait(lock, [&] { return stop_ || round_ != seen; });
      if (stop_) return;
      seen = round_;
    }
    take_chunks();
    const std::lock_guard lock(mutex_);
    if (--busy_ == 0) finished_.notify_one();
  }
}

void WorkerPool::take_chunks() {
  while (true) {
    const int chunk = next_.fetch_add(1);
    if (chunk >= chunks_) return;
    work_(context_, chunk);
  }
}

}  // namespace vantage
