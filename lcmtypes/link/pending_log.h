#pragma once

#include <filesystem>
#include <memory>

#include "lcmtypes/link/event_log.h"

namespace vantage {

/// A log that appears under its name when it is complete. Without a commit nothing of it is left, and a log that had
/// the name before stays as it was.
class PendingLog {
 public:
  /// \throws InputError when the folder does not exist or can't be written.
  explicit PendingLog(std::filesystem::path path, LogWriterOptions options = {});
  ~PendingLog();
  PendingLog(const PendingLog&) = delete;
  PendingLog& operator=(const PendingLog&) = delete;

  LogWriter& writer() { return *writer_; }
  /// Puts the parts in place, the first one last. \throws InputError when one can't be.
  void commit();

 private:
  std::filesystem::path path_, temporary_;
  std::unique_ptr<LogWriter> writer_;
};

}  // namespace vantage
