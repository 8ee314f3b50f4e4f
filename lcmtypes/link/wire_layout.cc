#include "lcmtypes/link/wire_layout.h"

#include <array>
#include <cctype>
#include <optional>

namespace vantage {
namespace {

constexpr std::size_t kFingerprintBytes = 8;
constexpr std::size_t kMostLengths = 4;

/// Walks a message without decoding it.
class Walker {
 public:
  explicit Walker(std::span<const std::uint8_t> bytes) : rest_(bytes) {}

  bool skip(std::size_t count, std::size_t element_bytes) {
    if (count > rest_.size() / element_bytes) return false;
    rest_ = rest_.subspan(count * element_bytes);
    return true;
  }

  /// A big-endian 32-bit length that is not negative.
  std::optional<std::size_t> length() {
    if (rest_.size() < 4) return std::nullopt;
    const std::uint32_t value = std::uint32_t{rest_[0]} << 24 | std::uint32_t{rest_[1]} << 16 |
                                std::uint32_t{rest_[2]} << 8 | std::uint32_t{rest_[3]};
    rest_ = rest_.subspan(4);
    if (value > INT32_MAX) return std::nullopt;
    return value;
  }

  bool string() {
    const std::optional<std::size_t> size = length();
    return size && *size > 0 && *size <= rest_.size() && rest_[*size - 1] == 0 && skip(*size, 1);
  }

  /// Ends at the first that does not fit, so that a claim of many costs nothing.
  bool strings(std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) {
      if (!string()) return false;
    }
    return true;
  }

  bool at_end() const { return rest_.empty(); }

 private:
  std::span<const std::uint8_t> rest_;
};

}  // namespace

bool layout_fits(std::string_view layout, std::span<const std::uint8_t> bytes) {
  Walker walker(bytes);
  if (!walker.skip(1, kFingerprintBytes)) return false;
  std::array<std::size_t, kMostLengths> lengths{};
  std::size_t known_lengths = 0;
  std::size_t repeat = 0;
  for (std::size_t i = 0; i < layout.size(); ++i) {
    const char code = layout[i];
    if (code == ' ') continue;
    if (std::isdigit(static_cast<unsigned char>(code))) {
      repeat = 10 * repeat + static_cast<std::size_t>(code - '0');
      continue;
    }
    const std::size_t count = repeat == 0 ? 1 : repeat;
    repeat = 0;
    bool fits = false;
    switch (code) {
      case 'q':
      case 'd':
        fits = walker.skip(count, 8);
        break;
      case 'i':
        fits = walker.skip(count, 4);
        break;
      case 'b':
        fits = walker.skip(count, 1);
        break;
      case 's':
        fits = walker.string();
        break;
      case 'n':
        if (const auto length = walker.length(); length && known_lengths < kMostLengths) {
          lengths[known_lengths++] = *length;
          fits = true;
        }
        break;
      case 'B':
      case 'I':
      case 'Q':
      case 'D':
        fits = walker.skip(lengths[static_cast<std::size_t>(layout[++i] - '0')], code == 'B' ? 1 : code == 'I' ? 4 : 8);
        break;
      case 'S':
        fits = walker.strings(lengths[static_cast<std::size_t>(layout[++i] - '0')]);
        break;
      default:
        break;
    }
    if (!fits) return false;
  }
  return walker.at_end();
}

}  // namespace vantage
