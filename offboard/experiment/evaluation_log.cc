#include "offboard/experiment/evaluation_log.h"

#include <charconv>
#include <iterator>
#include <sstream>
#include <utility>

#include <fmt/format.h>

#include "calib/files/atomic_file.h"
#include "calib/files/input_error.h"

namespace vantage {
namespace {

constexpr const char* kFirstLine = "vantage-experiment tune 1\n";

template <typename Number>
bool parse(const std::string& text, Number* number) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), *number);
  return error == std::errc() && end == text.data() + text.size();
}

std::string line_of(const std::string& name, std::size_t index, double value) {
  return fmt::format("{} {} {}\n", name, index, value);
}

}  // namespace

EvaluationLog::EvaluationLog(std::filesystem::path path, const std::string& head) : path_(std::move(path)) {
  const std::string begin = kFirstLine + head + "\n";  // an empty line ends the head
  std::ifstream old(path_, std::ios::binary);
  if (old) {
    const std::string text{std::istreambuf_iterator<char>(old), std::istreambuf_iterator<char>()};
    if (text.compare(0, begin.size(), begin) != 0) {
      throw InputError(path_.string() + ": was begun with other objects or options; repeat them, or add --overwrite");
    }
    std::size_t at = begin.size();
    for (std::size_t end = 0; (end = text.find('\n', at)) != std::string::npos; at = end + 1) {
      std::istringstream words(text.substr(at, end - at));
      std::string name, index_text, value_text;
      std::size_t index = 0;
      double value = 0;
      if (words >> name >> index_text >> value_text && parse(index_text, &index) && parse(value_text, &value)) {
        values_[{name, index}] = value;
      }
    }
  }
  AtomicFile whole(path_);
  whole.stream() << begin;
  for (const auto& [key, value] : values_) whole.stream() << line_of(key.first, key.second, value);
  whole.commit();
  stream_.open(path_, std::ios::app);
}

std::optional<double> EvaluationLog::find(const std::string& name, std::size_t index) const {
  const auto found = values_.find({name, index});
  return found == values_.end() ? std::nullopt : std::optional(found->second);
}

void EvaluationLog::add(const std::string& name, std::size_t index, double value) {
  values_[{name, index}] = value;
  stream_ << line_of(name, index, value) << std::flush;
  if (!stream_) throw InputError(path_.string() + ": can't be written; is the disk full?");
}

}  // namespace vantage
