#pragma once

#include <cstdint>
#include <deque>
#include <filesystem>
#include <string>
#include <vector>

#include <vantage/depth_map_t.hpp>

#include "calib/files/file_descriptor.h"
#include "lcmtypes/link/digest.h"

namespace vantage {

struct DepthMapSpoolOptions {
  std::filesystem::path folder;         ///< empty: in memory alone, lost with the program
  std::uint64_t most_bytes = 64 << 20;  ///< of all maps, in memory and again on disk
};

/// Depth maps that nobody has acknowledged yet, oldest first, within a limit; with a folder they outlive the program.
///
/// Each map is one file, there whole or not at all, removed with its receipt. One program at a time uses a folder.
class DepthMapSpool {
 public:
  struct Entry {
    std::int64_t session = 0, map_id = 0;
    std::vector<std::uint8_t> bytes;  ///< depth_map_t, encoded
    Digest digest{};
    std::filesystem::path file;  ///< empty without a folder
  };

  /// Takes over what an earlier start left in the folder; files that are no depth maps are counted, and stay.
  /// \throws InputError when the folder can't be made or read, or another program uses it.
  explicit DepthMapSpool(DepthMapSpoolOptions options = {});
  DepthMapSpool(const DepthMapSpool&) = delete;
  DepthMapSpool& operator=(const DepthMapSpool&) = delete;

  /// Adds a map; the oldest leave, and are counted, where it would not fit otherwise. The newest always stays.
  /// \throws InputError when the disk is full or gone: the map is in memory all the same.
  void push(const depth_map_t& map);
  /// Removes an entry for good: it has been acknowledged.
  void erase(std::size_t index);

  std::size_t size() const { return entries_.size(); }
  bool empty() const { return entries_.empty(); }
  const Entry& operator[](std::size_t index) const { return entries_[index]; }
  /// How many entries have left unacknowledged, from the front.
  std::uint64_t given_up() const { return given_up_; }
  std::uint64_t taken_over() const { return taken_over_; }  ///< from an earlier start
  std::uint64_t unreadable() const { return unreadable_; }  ///< files that are no depth maps

 private:
  void take_over_folder();
  void make_room();

  DepthMapSpoolOptions options_;
  std::deque<Entry> entries_;
  std::uint64_t bytes_ = 0, next_file_ = 1;
  std::uint64_t given_up_ = 0, taken_over_ = 0, unreadable_ = 0;
  FileDescriptor lock_;  // the folder's lock file
};

}  // namespace vantage
