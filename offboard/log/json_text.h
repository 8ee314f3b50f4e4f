#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace vantage {

/// Builds one JSON object or array from front to back.
///
///     JsonText json;
///     json.begin('{').key("x").number(0.5).key("list").begin('[').integer(1).integer(2).end(']').end('}');
class JsonText {
 public:
  JsonText& begin(char bracket);
  JsonText& end(char bracket);
  JsonText& key(std::string_view name);
  JsonText& text(std::string_view value);
  JsonText& integer(std::int64_t value);
  /// The shortest digits that give the value back; null when it is not finite, for which JSON has no word.
  JsonText& number(double value);
  JsonText& base64(std::span<const std::uint8_t> bytes);

  const std::string& str() const { return text_; }

 private:
  void comma();

  std::string text_;
  bool first_ = true;  // nothing before this value at its level
};

}  // namespace vantage
