#include "lcmtypes/link/link_key.h"

#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <string>
#include <string_view>

#include <fcntl.h>
#include <sodium.h>
#include <sys/stat.h>
#include <unistd.h>

#include "calib/files/file_descriptor.h"
#include "calib/files/input_error.h"

namespace vantage {
namespace {

/// The file: this word, the key in hexadecimal, a line feed.
constexpr std::string_view kFileMark = "vantage-key-1 ";
constexpr std::size_t kHexDigits = 2 * std::tuple_size_v<LinkKey>;
constexpr std::size_t kFileBytes = kFileMark.size() + kHexDigits + 1;

[[noreturn]] void fail(const std::filesystem::path& path, const std::string& fault) {
  throw InputError(path.string() + ": " + fault);
}

}  // namespace

LinkKey make_link_key() {
  if (sodium_init() < 0) throw std::runtime_error("libsodium finds no source of randomness");
  LinkKey key;
  randombytes_buf(key.data(), key.size());
  return key;
}

LinkKey read_link_key(const std::filesystem::path& path) {
  const FileDescriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (file.get() < 0) {
    fail(path, std::string("can't read the key: ") + std::strerror(errno) + "; vantage-keygen makes one");
  }
  struct stat status {};
  ::fstat(file.get(), &status);  // of the opened file: nobody can exchange it in between
  if (!S_ISREG(status.st_mode)) fail(path, "is no file with a key");
  if ((status.st_mode & 0077) != 0) {
    fail(path, "others than its owner can read or write this key: run  chmod 600 " + path.string());
  }
  std::string text(kFileBytes + 1, '\0');
  const ssize_t size = ::read(file.get(), text.data(), text.size());
  LinkKey key;
  std::size_t decoded = 0;
  if (size != static_cast<ssize_t>(kFileBytes) || !text.starts_with(kFileMark) || text[kFileBytes - 1] != '\n' ||
      sodium_hex2bin(key.data(), key.size(), text.data() + kFileMark.size(), kHexDigits, nullptr, &decoded, nullptr) !=
          0 ||
      decoded != key.size()) {
    fail(path, "is no key of vantage-keygen");
  }
  sodium_memzero(text.data(), text.size());
  return key;
}

void write_link_key(const std::filesystem::path& path, const LinkKey& key) {
  std::string hex(kHexDigits + 1, '\0');
  sodium_bin2hex(hex.data(), hex.size(), key.data(), key.size());
  hex.back() = '\n';
  const std::string text = std::string(kFileMark) + hex;
  const FileDescriptor file(::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600));
  if (file.get() < 0) {
    fail(path, errno == EEXIST ? "exists already, and a lost key can't be had again: give another name"
                               : std::string("can't be made: ") + std::strerror(errno));
  }
  if (::fchmod(file.get(), 0600) != 0 || ::write(file.get(), text.data(), text.size()) != ssize_t(text.size()) ||
      ::fsync(file.get()) != 0) {
    const int error = errno;
    ::unlink(path.c_str());
    fail(path, std::string("can't be written: ") + std::strerror(error));
  }
}

}  // namespace vantage
