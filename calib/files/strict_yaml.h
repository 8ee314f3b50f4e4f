#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Geometry>

namespace vantage {

/// What a number with a unit measures. Each is returned in its SI unit.
enum class Quantity {
  kLength,               ///< m (also cm, mm)
  kAngle,                ///< rad (also deg)
  kDuration,             ///< s (also ms, us)
  kSpeed,                ///< m/s (also mm/s)
  kAngularSpeed,         ///< rad/s (also deg/s)
  kAcceleration,         ///< m/s2
  kAngularAcceleration,  ///< rad/s2 (also deg/s2)
  kPixels,               ///< px
  kFrequency,            ///< Hz
  kBitRate,              ///< bit/s (also kbit/s, Mbit/s)
};

/// A YAML mapping that insists: every key must be known, every value must have the type and the unit that is asked for.
///
///     YamlMap root = YamlMap::load("rig.yaml");
///     rig.baseline_m = root.quantity("baseline", Quantity::kLength);  // baseline: 0.1 m
///     root.finish();                                                  // any key that nobody read is an error
///
/// Every fault is an InputError "file:line: key: what was expected". A bare number where a unit belongs is a fault too.
class YamlMap {
 public:
  /// \throws InputError when the file is absent, is not YAML, or holds no mapping.
  static YamlMap load(const std::filesystem::path& path);
  /// The same from a text; `name` stands for the file in messages.
  static YamlMap parse(const std::string& text, const std::string& name);

  bool has(std::string_view key) const;
  bool is_list(std::string_view key) const;

  double number(std::string_view key);
  std::int64_t integer(std::string_view key);
  bool boolean(std::string_view key);
  std::string text(std::string_view key);
  double quantity(std::string_view key, Quantity kind);
  /// A list of plain numbers, of exactly `size` entries unless `size` is 0.
  std::vector<double> numbers(std::string_view key, std::size_t size);
  /// A list of numbers with units, of exactly `size` entries.
  std::vector<double> quantities(std::string_view key, Quantity kind, std::size_t size);
  YamlMap map(std::string_view key);

  /// \throws InputError for the first key that no call has read, with the keys that are known.
  void finish() const;

  /// Fails as the class does for its own faults, for a value whose meaning is wrong (a negative speed).
  [[noreturn]] void fail(std::string_view key, const std::string& fault) const;

 private:
  struct Impl;
  explicit YamlMap(std::shared_ptr<Impl> impl);
  std::shared_ptr<Impl> impl_;
};

/// `value` and its unit, as YamlMap reads it back to the same bits: "0.1 m".
std::string yaml_quantity(double value, Quantity kind);

}  // namespace vantage
