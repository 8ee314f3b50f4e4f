#include "lcmtypes/link/file_sync.h"

#include <algorithm>
#include <cerrno>

#include <unistd.h>

namespace vantage {

FileSync::FileSync(std::chrono::milliseconds period) : period_(period), thread_([this] { run(); }) {}

FileSync::~FileSync() {
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
  }
  wake_.notify_one();
  thread_.join();
}

void FileSync::changed(const std::shared_ptr<const FileDescriptor>& file) {
  const std::lock_guard lock(mutex_);
  if (std::find(changed_.begin(), changed_.end(), file) == changed_.end()) changed_.push_back(file);
}

void FileSync::run() {
  std::unique_lock lock(mutex_);
  for (bool last = false; !last;) {
    last = wake_.wait_for(lock, period_, [this] { return ending_; });
    const std::vector<std::shared_ptr<const FileDescriptor>> files = std::exchange(changed_, {});
    lock.unlock();
    for (const auto& file : files) {
      // A file system without fdatasync (EINVAL, ENOSYS) can't do better; a disk that fails can be told.
      if (::fdatasync(file->get()) != 0 && errno != EINVAL && errno != ENOSYS && error_ == 0) error_ = errno;
    }
    lock.lock();
  }
}

}  // namespace vantage
