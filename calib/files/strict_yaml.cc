#include "calib/files/strict_yaml.h"

#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <set>

#include <yaml-cpp/yaml.h>

#include "calib/files/input_error.h"

namespace vantage {
namespace {

struct Unit {
  Quantity kind;
  const char* name;
  double si;  // one of it, in the SI unit
};

// The first unit of a kind is its SI unit: messages and yaml_quantity use it.
constexpr std::array kUnits{
    Unit{Quantity::kLength, "m", 1},
    Unit{Quantity::kLength, "cm", 0.01},
    Unit{Quantity::kLength, "mm", 0.001},
    Unit{Quantity::kAngle, "rad", 1},
    Unit{Quantity::kAngle, "deg", M_PI / 180},
    Unit{Quantity::kDuration, "s", 1},
    Unit{Quantity::kDuration, "ms", 1e-3},
    Unit{Quantity::kDuration, "us", 1e-6},
    Unit{Quantity::kSpeed, "m/s", 1},
    Unit{Quantity::kSpeed, "mm/s", 0.001},
    Unit{Quantity::kAngularSpeed, "rad/s", 1},
    Unit{Quantity::kAngularSpeed, "deg/s", M_PI / 180},
    Unit{Quantity::kAcceleration, "m/s2", 1},
    Unit{Quantity::kAngularAcceleration, "rad/s2", 1},
    Unit{Quantity::kAngularAcceleration, "deg/s2", M_PI / 180},
    Unit{Quantity::kPixels, "px", 1},
    Unit{Quantity::kFrequency, "Hz", 1},
    Unit{Quantity::kBitRate, "bit/s", 1},
    Unit{Quantity::kBitRate, "kbit/s", 1e3},
    Unit{Quantity::kBitRate, "Mbit/s", 1e6},
};

const char* si_unit(Quantity kind) {
  for (const Unit& unit : kUnits) {
    if (unit.kind == kind) return unit.name;
  }
  return "";
}

/// A finite number that fills `text` to its end.
std::optional<double> to_number(std::string_view text) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

std::optional<double> to_quantity(std::string_view text, Quantity kind) {
  const std::size_t space = text.find(' ');
  if (space == std::string_view::npos) return std::nullopt;
  const std::size_t name = text.find_first_not_of(' ', space);
  const std::optional<double> value = to_number(text.substr(0, space));
  if (!value || name == std::string_view::npos) return std::nullopt;
  for (const Unit& unit : kUnits) {
    if (unit.kind == kind && text.substr(name) == unit.name) return *value * unit.si;
  }
  return std::nullopt;
}

}  // namespace

struct YamlMap::Impl {
  std::string file;
  std::string path;  // of keys, for messages: "limits."
  YAML::Node node;
  std::set<std::string, std::less<>> known;

  [[noreturn]] void fail(const YAML::Mark& mark, const std::string& key, const std::string& fault) const {
    const std::string line = mark.is_null() ? "" : std::to_string(mark.line + 1) + ":";
    throw InputError(file + ":" + line + " " + (key.empty() ? "" : path + key + ": ") + fault);
  }

  YAML::Node child(std::string_view key) {
    known.emplace(key);
    const YAML::Node value = std::as_const(node)[std::string(key)];
    if (!value) fail(node.Mark(), std::string(key), "is missing");
    return value;
  }

  std::string scalar(const YAML::Node& value, std::string_view key, const std::string& expected) const {
    if (!value.IsScalar()) fail(value.Mark(), std::string(key), "expected " + expected);
    return value.Scalar();
  }
};

YamlMap::YamlMap(std::shared_ptr<Impl> impl) : impl_(std::move(impl)) {
  std::set<std::string> seen;
  for (const auto& entry : impl_->node) {
    if (!entry.first.IsScalar()) impl_->fail(entry.first.Mark(), "", "a key must be a plain word");
    if (!seen.insert(entry.first.Scalar()).second)
      impl_->fail(entry.first.Mark(), entry.first.Scalar(), "stands twice");
  }
}

YamlMap YamlMap::load(const std::filesystem::path& path) {
  try {
    const YAML::Node node = YAML::LoadFile(path.string());
    if (!node.IsMap()) throw InputError(path.string() + ": expected a YAML mapping (lines of \"key: value\")");
    return YamlMap(std::make_shared<Impl>(Impl{path.string(), "", node, {}}));
  } catch (const YAML::BadFile&) {
    throw InputError(path.string() + ": no such file, or it can't be read");
  } catch (const YAML::ParserException& error) {
    throw InputError(path.string() + ":" + std::to_string(error.mark.line + 1) + ": not YAML: " + error.msg);
  }
}

YamlMap YamlMap::parse(const std::string& text, const std::string& name) {
  try {
    const YAML::Node node = YAML::Load(text);
    if (!node.IsMap()) throw InputError(name + ": expected a YAML mapping (lines of \"key: value\")");
    return YamlMap(std::make_shared<Impl>(Impl{name, "", node, {}}));
  } catch (const YAML::ParserException& error) {
    throw InputError(name + ":" + std::to_string(error.mark.line + 1) + ": not YAML: " + error.msg);
  }
}

bool YamlMap::has(std::string_view key) const {
  impl_->known.emplace(key);
  return static_cast<bool>(std::as_const(impl_->node)[std::string(key)]);
}

bool YamlMap::is_list(std::string_view key) const {
  const YAML::Node value = std::as_const(impl_->node)[std::string(key)];
  return value && value.IsSequence();
}

double YamlMap::number(std::string_view key) {
  const YAML::Node value = impl_->child(key);
  const std::optional<double> number = to_number(impl_->scalar(value, key, "a number"));
  if (!number) impl_->fail(value.Mark(), std::string(key), "expected a number, found \"" + value.Scalar() + "\"");
  return *number;
}

std::int64_t YamlMap::integer(std::string_view key) {
  const YAML::Node value = impl_->child(key);
  const std::string text = impl_->scalar(value, key, "a whole number");
  std::int64_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || end != text.data() + text.size()) {
    impl_->fail(value.Mark(), std::string(key), "expected a whole number, found \"" + text + "\"");
  }
  return number;
}

bool YamlMap::boolean(std::string_view key) {
  const YAML::Node value = impl_->child(key);
  const std::string text = impl_->scalar(value, key, "true or false");
  if (text != "true" && text != "false") {
    impl_->fail(value.Mark(), std::string(key), "expected true or false, found \"" + text + "\"");
  }
  return text == "true";
}

std::string YamlMap::text(std::string_view key) { return impl_->scalar(impl_->child(key), key, "a text"); }

double YamlMap::quantity(std::string_view key, Quantity kind) {
  const YAML::Node value = impl_->child(key);
  const std::string expected = std::string("a number with its unit, e.g. 0.5 ") + si_unit(kind);
  const std::optional<double> number = to_quantity(impl_->scalar(value, key, expected), kind);
  if (!number)
    impl_->fail(value.Mark(), std::string(key), "expected " + expected + ", found \"" + value.Scalar() + "\"");
  return *number;
}

std::vector<double> YamlMap::numbers(std::string_view key, std::size_t size) {
  const YAML::Node list = impl_->child(key);
  const std::string expected = size == 0 ? "a list of numbers" : "a list of " + std::to_string(size) + " numbers";
  if (!list.IsSequence() || (size != 0 && list.size() != size)) {
    impl_->fail(list.Mark(), std::string(key), "expected " + expected);
  }
  std::vector<double> result;
  for (const YAML::Node& entry : list) {
    const std::optional<double> number = entry.IsScalar() ? to_number(entry.Scalar()) : std::nullopt;
    if (!number) impl_->fail(entry.Mark(), std::string(key), "expected " + expected);
    result.push_back(*number);
  }
  return result;
}

std::vector<double> YamlMap::quantities(std::string_view key, Quantity kind, std::size_t size) {
  const YAML::Node list = impl_->child(key);
  const std::string expected =
      "a list of " + std::to_string(size) + " numbers with their unit, e.g. 0.5 " + si_unit(kind);
  if (!list.IsSequence() || list.size() != size) impl_->fail(list.Mark(), std::string(key), "expected " + expected);
  std::vector<double> result;
  for (const YAML::Node& entry : list) {
    const std::optional<double> number = entry.IsScalar() ? to_quantity(entry.Scalar(), kind) : std::nullopt;
    if (!number) impl_->fail(entry.Mark(), std::string(key), "expected " + expected);
    result.push_back(*number);
  }
  return result;
}

YamlMap YamlMap::map(std::string_view key) {
  const YAML::Node value = impl_->child(key);
  if (!value.IsMap())
    impl_->fail(value.Mark(), std::string(key), "expected a mapping (indented lines of \"key: value\")");
  return YamlMap(std::make_shared<Impl>(Impl{impl_->file, impl_->path + std::string(key) + ".", value, {}}));
}

void YamlMap::finish() const {
  for (const auto& entry : impl_->node) {
    const std::string& key = entry.first.Scalar();
    if (impl_->known.count(key) != 0) continue;
    std::string names;
    for (const std::string& name : impl_->known) names += (names.empty() ? "" : ", ") + name;
    impl_->fail(entry.first.Mark(), key, "unknown key; known here: " + names);
  }
}

void YamlMap::fail(std::string_view key, const std::string& fault) const {
  const YAML::Node value = std::as_const(impl_->node)[std::string(key)];
  impl_->fail(value ? value.Mark() : impl_->node.Mark(), std::string(key), fault);
}

std::string yaml_quantity(double value, Quantity kind) {
  std::array<char, 32> digits{};
  const auto [end, error] = std::to_chars(digits.data(), digits.data() + digits.size(), value);  // shortest exact
  return std::string(digits.data(), end) + " " + si_unit(kind);
}

}  // namespace vantage
