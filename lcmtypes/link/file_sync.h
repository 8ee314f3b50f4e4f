#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "calib/files/file_descriptor.h"

namespace vantage {

/// Writes changed files through to the disk, at most once a period, in a thread of its own: what was written longer ago
/// survives a loss of power, and the writer never waits for the disk.
class FileSync {
 public:
  explicit FileSync(std::chrono::milliseconds period = std::chrono::seconds(1));
  /// Writes through what is left.
  ~FileSync();
  FileSync(const FileSync&) = delete;
  FileSync& operator=(const FileSync&) = delete;

  void changed(const std::shared_ptr<const FileDescriptor>& file);
  /// errno of the first file that could not be written through; 0: none so far.
  int error() const { return error_; }

 private:
  void run();

  const std::chrono::milliseconds period_;
  std::mutex mutex_;  // guards changed_ and ending_
  std::condition_variable wake_;
  std::vector<std::shared_ptr<const FileDescriptor>> changed_;
  bool ending_ = false;
  std::atomic<int> error_ = 0;
  std::thread thread_;
};

}  // namespace vantage
