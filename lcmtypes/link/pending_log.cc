#include "lcmtypes/link/pending_log.h"

#include <string>
#include <system_error>

#include <unistd.h>

#include "calib/files/input_error.h"

namespace vantage {

namespace fs = std::filesystem;

PendingLog::PendingLog(fs::path path, LogWriterOptions options)
    : path_(std::move(path)),
      temporary_(path_.parent_path() /
                 (path_.stem().string() + ".tmp-" + std::to_string(::getpid()) + path_.extension().string())) {
  try {
    writer_ = std::make_unique<LogWriter>(temporary_, std::move(options));
  } catch (const InputError& error) {  // it names the temporary file
    std::string fault = error.what();
    throw InputError(fault.replace(0, temporary_.string().size(), path_.string()));
  }
}

PendingLog::~PendingLog() {
  writer_.reset();
  std::error_code ignored;
  for (std::size_t part = count_log_parts(temporary_); part-- > 0;) fs::remove(log_part(temporary_, part), ignored);
}

void PendingLog::commit() {
  writer_.reset();
  remove_later_parts(path_);
  for (std::size_t part = count_log_parts(temporary_); part-- > 0;) {
    std::error_code error;
    fs::rename(log_part(temporary_, part), log_part(path_, part), error);
    if (error) throw InputError(log_part(path_, part).string() + ": can't be put in place: " + error.message());
  }
}

}  // namespace vantage
