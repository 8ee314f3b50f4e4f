#include "lcmtypes/link/depth_map_spool.h"

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <fstream>
#include <iterator>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include "calib/files/atomic_file.h"
#include "calib/files/input_error.h"
#include "lcmtypes/link/message.h"

namespace vantage {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kSuffix = ".map";
constexpr std::size_t kNumberDigits = 12;  // of a file's name: names sort as the maps came

fs::path file_name(std::uint64_t number) {
  std::string digits = std::to_string(number);
  return std::string(kNumberDigits - std::min(kNumberDigits, digits.size()), '0') + digits + std::string(kSuffix);
}

/// The number in a map's file name; 0: not one of ours.
std::uint64_t number_of(const fs::path& file) {
  const std::string name = file.filename().string();
  if (name.size() != kNumberDigits + kSuffix.size() || !name.ends_with(kSuffix)) return 0;
  std::uint64_t number = 0;
  const auto [end, error] = std::from_chars(name.data(), name.data() + kNumberDigits, number);
  return error == std::errc() && end == name.data() + kNumberDigits ? number : 0;
}

std::vector<std::uint8_t> read_file(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

}  // namespace

DepthMapSpool::DepthMapSpool(DepthMapSpoolOptions options) : options_(std::move(options)) {
  if (options_.folder.empty()) return;
  std::error_code error;
  fs::create_directories(options_.folder, error);
  if (error) throw InputError(options_.folder.string() + ": can't be made: " + error.message());
  const fs::path lock = options_.folder / "lock";
  lock_ = FileDescriptor(::open(lock.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644));
  if (!lock_.valid()) throw InputError(lock.string() + ": can't be made: " + std::strerror(errno));
  if (::flock(lock_.get(), LOCK_EX | LOCK_NB) != 0) {
    throw InputError(options_.folder.string() + ": another program uses this spool; give another folder");
  }
  take_over_folder();
}

void DepthMapSpool::take_over_folder() {
  std::vector<std::pair<std::uint64_t, fs::path>> files;
  std::error_code error;
  for (const fs::directory_entry& file : fs::directory_iterator(options_.folder, error)) {
    if (const std::uint64_t number = number_of(file.path()); number > 0) files.emplace_back(number, file.path());
    // A neighbour that AtomicFile did not come to rename: half a map of a program that was killed.
    if (file.path().filename().string().find(".map.tmp-") != std::string::npos) fs::remove(file.path(), error);
  }
  if (error) throw InputError(options_.folder.string() + ": can't be read: " + error.message());
  std::sort(files.begin(), files.end());
  for (auto& [number, path] : files) {
    next_file_ = number + 1;
    Entry entry{0, 0, read_file(path), {}, std::move(path)};
    depth_map_t map;
    DecodeCounters ignored;
    if (!decode_message(entry.bytes, &map, &ignored)) {
      ++unreadable_;
      continue;
    }
    entry.session = map.session;
    entry.map_id = map.map_id;
    entry.digest = digest_of(entry.bytes);
    bytes_ += entry.bytes.size();
    entries_.push_back(std::move(entry));
    ++taken_over_;
  }
  make_room();
}

void DepthMapSpool::push(const depth_map_t& map) {
  Entry entry{map.session, map.map_id, encode_message(map), {}, {}};
  entry.digest = digest_of(entry.bytes);
  bytes_ += entry.bytes.size();
  entries_.push_back(std::move(entry));
  make_room();
  if (options_.folder.empty()) return;
  const fs::path path = options_.folder / file_name(next_file_++);
  AtomicFile file(path);
  const std::vector<std::uint8_t>& bytes = entries_.back().bytes;
  file.stream().write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  file.commit();
  entries_.back().file = path;
}

void DepthMapSpool::make_room() {
  while (entries_.size() > 1 && bytes_ > options_.most_bytes) {
    erase(0);
    ++given_up_;
  }
}

void DepthMapSpool::erase(std::size_t index) {
  const auto entry = entries_.begin() + static_cast<std::ptrdiff_t>(index);
  std::error_code ignored;  // a file that stays is sent again, and known by its digest
  if (!entry->file.empty()) fs::remove(entry->file, ignored);
  bytes_ -= entry->bytes.size();
  entries_.erase(entry);
}

}  // namespace vantage
