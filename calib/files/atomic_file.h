#pragma once

#include <filesystem>
#include <fstream>

namespace vantage {

/// A file that appears under its name whole or not at all.
///
/// Writes go to a neighbour (`NAME.tmp-PID`); `commit()` flushes it and renames it over `path`. Without a commit the
/// neighbour is removed.
///
///     AtomicFile file("cloud.ply");
///     file.stream() << ...;
///     file.commit();
class AtomicFile {
 public:
  /// \throws InputError when the folder does not exist or can't be written.
  explicit AtomicFile(std::filesystem::path path);
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  std::ostream& stream() { return stream_; }
  /// The neighbour's name, for libraries that write to a path of their own.
  const std::filesystem::path& temporary() const { return temporary_; }

  /// \throws InputError when a write failed (a full disk) or the file can't be renamed.
  void commit();

 private:
  std::filesystem::path path_;
  std::filesystem::path temporary_;
  std::ofstream stream_;
  bool committed_ = false;
};

}  // namespace vantage
