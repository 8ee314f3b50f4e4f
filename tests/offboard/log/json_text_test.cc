#include "offboard/log/json_text.h"

#include <cmath>
#include <cstdlib>

#include <gtest/gtest.h>

#include "offboard/log/crc32.h"

namespace vantage {
namespace {

std::string base64(std::string_view text) {
  JsonText json;
  json.base64({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
  return json.str().substr(1, json.str().size() - 2);
}

std::string quoted(std::string_view text) { return JsonText().text(text).str(); }

TEST(JsonText, Base64IsThatOfRfc4648) {
  EXPECT_EQ(base64(""), "");
  EXPECT_EQ(base64("f"), "Zg==");
  EXPECT_EQ(base64("fo"), "Zm8=");
  EXPECT_EQ(base64("foo"), "Zm9v");
  EXPECT_EQ(base64("foob"), "Zm9vYg==");
  EXPECT_EQ(base64("fooba"), "Zm9vYmE=");
  EXPECT_EQ(base64("foobar"), "Zm9vYmFy");
  EXPECT_EQ(base64("\xfb\xff\xfe"), "+//+");
}

TEST(JsonText, TextIsEscapedAndAlwaysUtf8) {
  EXPECT_EQ(quoted("a\"\\\n\x1f"), R"("a\"\\\u000a\u001f")");
  EXPECT_EQ(quoted("µ€😀"), "\"µ€😀\"");
  EXPECT_EQ(quoted("a\xff"), "\"a\xEF\xBF\xBD\"");
  EXPECT_EQ(quoted("\xc0\xaf"), "\"\xEF\xBF\xBD\xEF\xBF\xBD\"");              // overlong
  EXPECT_EQ(quoted("\xe2\x82"), "\"\xEF\xBF\xBD\xEF\xBF\xBD\"");              // cut short
  EXPECT_EQ(quoted("\xed\xa0\x80").find("\xed\xa0\x80"), std::string::npos);  // a surrogate
}

TEST(JsonText, NumbersComeBackToTheBit) {
  for (const double value : {0.1, -1e-300, 1.0 / 3, 1e22, 5e-324}) {
    EXPECT_EQ(std::strtod(JsonText().number(value).str().c_str(), nullptr), value);
  }
  EXPECT_EQ(JsonText().number(INFINITY).str(), "null");
  EXPECT_EQ(JsonText().begin('[').integer(INT64_MIN).number(2).begin('{').end('}').begin('[').end(']').end(']').str(),
            "[-9223372036854775808,2,{},[]]");
}

TEST(Crc32, IsThatOfTheStandardWhereverItIsSplit) {
  EXPECT_EQ(crc32("123456789"), 0xCBF43926U);
  const std::string text = "The quick brown fox jumps over the lazy dog";
  EXPECT_EQ(crc32(text), 0x414FA339U);
  for (std::size_t i = 0; i <= text.size(); ++i) {
    EXPECT_EQ(crc32(std::string_view(text).substr(i), crc32(std::string_view(text).substr(0, i))), 0x414FA339U) << i;
  }
}

}  // namespace
}  // namespace vantage
