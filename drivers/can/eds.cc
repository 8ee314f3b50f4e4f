#include "drivers/can/eds.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <fstream>
#include <iterator>
#include <map>
#include <optional>

#include "calib/files/input_error.h"

namespace vantage::can {
namespace {

constexpr std::uint16_t kFirstType = 0x01, kLastType = 0x1B;  // static data types of CiA 301
constexpr std::int64_t kRecordTypes[] = {0x7, 0x8, 0x9};      // var, array, record
constexpr std::uint8_t kMostSubindices = 254;

std::string lower(std::string_view text) {
  std::string result(text);
  std::transform(result.begin(), result.end(), result.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return result;
}

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view kSpace = " \t\r\v\f";
  const std::size_t first = text.find_first_not_of(kSpace);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kSpace) - first + 1);
}

struct Value {
  std::string text;
  int line = 0;
};

struct Section {
  int line = 0;
  std::map<std::string, Value> values;
};

using Sections = std::map<std::string, Section>;

class Reader {
 public:
  Reader(std::string name, std::uint8_t node) : name_(std::move(name)), node_(node) {}

  Eds read(std::string_view text) {
    split(text);
    Eds eds;
    if (const Section* info = find("deviceinfo")) {
      eds.vendor_name = text_of(*info, "vendorname");
      eds.product_name = text_of(*info, "productname");
      eds.vendor = static_cast<std::uint32_t>(number(*info, "vendornumber").value_or(0));
      eds.product = static_cast<std::uint32_t>(number(*info, "productnumber").value_or(0));
    }
    if (const Section* commissioning = find("devicecomissioning")) {
      eds.node = static_cast<int>(number(*commissioning, "nodeid").value_or(0));
      if (eds.node < 0 || eds.node > 127) fail(commissioning->line, "NodeID must be 1 to 127");
      if (eds.node != 0) node_ = static_cast<std::uint8_t>(eds.node);
    }
    for (const auto& [key, section] : sections_) read_object(key, section, &eds.objects);
    if (eds.objects.empty()) throw InputError(name_ + ": describes no object; is it an EDS or DCF file?");
    return eds;
  }

 private:
  [[noreturn]] void fail(int line, const std::string& fault) const {
    throw InputError(name_ + ":" + std::to_string(line) + ": " + fault);
  }

  void split(std::string_view text) {
    Section* section = nullptr;
    int line_number = 0;
    while (!text.empty()) {
      const std::size_t end = std::min(text.find('\n'), text.size());
      const std::string_view line = trimmed(text.substr(0, end));
      text.remove_prefix(std::min(end + 1, text.size()));
      ++line_number;
      if (line.empty() || line.front() == ';' || line.front() == '#') continue;
      if (line.front() == '[') {
        if (line.back() != ']') fail(line_number, "a section's name ends with ]");
        section = &sections_[lower(trimmed(line.substr(1, line.size() - 2)))];
        section->line = line_number;
        continue;
      }
      const std::size_t equals = line.find('=');
      if (equals == std::string_view::npos) fail(line_number, "expected key=value or [section]");
      if (section == nullptr) fail(line_number, "stands before the first [section]");
      section->values[lower(trimmed(line.substr(0, equals)))] = {std::string(trimmed(line.substr(equals + 1))),
                                                                 line_number};
    }
  }

  const Section* find(const std::string& key) const {
    const auto found = sections_.find(key);
    return found == sections_.end() ? nullptr : &found->second;
  }

  static std::string text_of(const Section& section, const std::string& key) {
    const auto found = section.values.find(key);
    return found == section.values.end() ? "" : found->second.text;
  }

  /// A number; empty where the key is absent or has no value.
  std::optional<std::int64_t> number(const Section& section, const std::string& key) const {
    const auto found = section.values.find(key);
    if (found == section.values.end() || found->second.text.empty()) return {};
    std::string_view text = found->second.text;
    std::int64_t sum = 0;
    constexpr std::string_view kNode = "$nodeid";
    if (lower(text.substr(0, kNode.size())) == kNode) {
      sum = node_;
      text = trimmed(text.substr(kNode.size()));
      if (text.empty()) return sum;
      if (text.front() != '+') fail(found->second.line, key + ": expected $NODEID+number");
      text = trimmed(text.substr(1));
    }
    const std::string_view all = text;
    const bool negative = !text.empty() && text.front() == '-';
    if (negative) text.remove_prefix(1);
    const bool hexadecimal = text.size() > 2 && text.front() == '0' && (text[1] == 'x' || text[1] == 'X');
    if (hexadecimal) text.remove_prefix(2);
    std::uint64_t magnitude = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), magnitude, hexadecimal ? 16 : 10);
    if (error != std::errc() || end != text.data() + text.size() || magnitude > UINT32_MAX) {
      fail(found->second.line, key + ": expected a number of up to 32 bits, found \"" + std::string(all) + "\"");
    }
    const auto value = static_cast<std::int64_t>(magnitude);
    return sum + (negative ? -value : value);
  }

  /// "1018sub1" → 1018:1. Empty for sections that describe no object.
  static std::optional<ObjectAddress> address_of(const std::string& section) {
    if (section.size() < 4) return {};
    ObjectAddress address;
    const char* const first = section.data();
    const auto [index_end, index_error] = std::from_chars(first, first + 4, address.index, 16);
    if (index_error != std::errc() || index_end != first + 4 || address.index < 0x1000) return {};
    if (section.size() == 4) return address;
    if (section.compare(4, 3, "sub") != 0 || section.size() == 7) return {};
    const char* const last = first + section.size();
    const auto [sub_end, sub_error] = std::from_chars(first + 7, last, address.sub, 16);
    if (sub_error != std::errc() || sub_end != last) return {};
    return address;
  }

  void read_object(const std::string& key, const Section& section, ObjectMap* objects) const {
    const std::optional<ObjectAddress> address = address_of(key);
    if (!address) return;
    const std::int64_t kind = number(section, "objecttype").value_or(0x7);
    if (std::find(std::begin(kRecordTypes), std::end(kRecordTypes), kind) == std::end(kRecordTypes)) return;
    if (kind != 0x7) {
      expand_compact(*address, section, objects);
      return;  // its values are in the subN sections
    }
    (*objects)[*address] = read_entry(section);
  }

  /// CompactSubObj=N: N entries of one kind, without sections of their own.
  void expand_compact(ObjectAddress address, const Section& section, ObjectMap* objects) const {
    const std::int64_t count = number(section, "compactsubobj").value_or(0);
    if (count == 0) return;
    if (count < 0 || count > kMostSubindices) fail(section.line, "CompactSubObj must be 1 to 254");
    ObjectEntry number_of_entries;
    number_of_entries.name = "number of entries";
    number_of_entries.type = DataType::kUnsigned8;
    objects->insert({{address.index, 0}, number_of_entries});
    const ObjectEntry entry = read_entry(section);
    for (std::int64_t sub = 1; sub <= count; ++sub) {
      objects->insert({{address.index, static_cast<std::uint8_t>(sub)}, entry});
    }
  }

  ObjectEntry read_entry(const Section& section) const {
    ObjectEntry entry;
    entry.name = text_of(section, "parametername");
    const std::optional<std::int64_t> type = number(section, "datatype");
    if (!type) fail(section.line, "DataType is missing");
    if (*type < kFirstType || (*type > kLastType && *type < 0x40)) fail(section.line, "DataType is not one of CiA 301");
    entry.type = static_cast<DataType>(*type);
    const std::string access = lower(text_of(section, "accesstype"));
    entry.writable = access == "rw" || access == "wo" || access == "rww" || access == "rwr";
    if (size_of(entry.type) == 0) return entry;
    entry.low_limit = number(section, "lowlimit");
    entry.high_limit = number(section, "highlimit");
    entry.value = number(section, "parametervalue");
    if (!entry.value) entry.value = number(section, "defaultvalue");
    for (std::optional<std::int64_t>* value : {&entry.low_limit, &entry.high_limit, &entry.value}) {
      if (*value) **value = as_type(entry.type, **value);
    }
    if (entry.low_limit && entry.high_limit && *entry.low_limit > *entry.high_limit) {
      fail(section.line, "LowLimit is above HighLimit");
    }
    if (entry.value && ((entry.low_limit && *entry.value < *entry.low_limit) ||
                        (entry.high_limit && *entry.value > *entry.high_limit))) {
      fail(section.line, "its value lies outside its limits");
    }
    return entry;
  }

  /// Many files write a negative number as the bits of its type: 0xFFFFFFFF of an INTEGER32 is -1.
  static std::int64_t as_type(DataType type, std::int64_t value) {
    if (!is_signed(type)) return value;
    const std::int64_t span = std::int64_t{1} << (8 * size_of(type));
    return value >= span / 2 && value < span ? value - span : value;
  }

  std::string name_;
  std::uint8_t node_;
  Sections sections_;
};

}  // namespace

Eds load_eds(const std::filesystem::path& path, std::uint8_t node) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw InputError(path.string() + ": no such file, or it can't be read");
  const std::string text((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  return parse_eds(text, path.string(), node);
}

Eds parse_eds(std::string_view text, const std::string& name, std::uint8_t node) {
  return Reader(name, node).read(text);
}

}  // namespace vantage::can
