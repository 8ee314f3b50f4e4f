#include "onboard/depth/depth_worker.h"

#include <utility>

namespace vantage {

DepthWorker::DepthWorker(std::unique_ptr<DepthFilter> filter, Finished finished)
    : filter_(std::move(filter)), finished_(std::move(finished)), thread_([this] { run(); }) {}

DepthWorker::~DepthWorker() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  offered_.notify_one();
  thread_.join();
}

void DepthWorker::offer(PosedImage frame, bool anew) {
  {
    const std::lock_guard lock(mutex_);
    if (waiting_) ++passed_over_;
    waiting_ = std::move(frame);
    anew_ = anew_ || anew;
  }
  offered_.notify_one();
}

void DepthWorker::drain() {
  std::unique_lock lock(mutex_);
  idle_.wait(lock, [this] { return !busy_ && !waiting_; });
}

std::uint64_t DepthWorker::passed_over() const {
  const std::lock_guard lock(mutex_);
  return passed_over_;
}

std::uint64_t DepthWorker::used() const {
  const std::lock_guard lock(mutex_);
  return used_;
}

void DepthWorker::run() {
  std::optional<PosedImage> key;
  while (true) {
    PosedImage frame;
    {
      std::unique_lock lock(mutex_);
      busy_ = false;
      if (!waiting_) idle_.notify_all();
      offered_.wait(lock, [this] { return stop_ || waiting_; });
      if (stop_) return;
      frame = std::move(*waiting_);
      waiting_.reset();
      if (std::exchange(anew_, false)) key.reset();
      busy_ = true;
    }
    const FrameUse use = key ? filter_->update(frame) : filter_->start(frame);
    if (use != FrameUse::kUsed) continue;
    if (!key) {
      key = frame;
    } else if (filter_->key_frame_end() != KeyFrameEnd::kNotYet) {
      finished_(*filter_, *key);
      if (filter_->advance(frame) == FrameUse::kUsed) key = frame;
    }
    const std::lock_guard lock(mutex_);
    ++used_;
  }
}

}  // namespace vantage
