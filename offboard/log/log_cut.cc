#include "offboard/log/log_cut.h"

#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <vector>

#include <regex.h>

#include "calib/files/input_error.h"
#include "lcmtypes/link/message_bus.h"
#include "lcmtypes/link/pending_log.h"
#include "offboard/log/log_scan.h"
#include "offboard/session/session_config.h"

namespace vantage {
namespace {

constexpr double kFirstUnixTime = 1e8;  // s: no log is three years long
constexpr double kLastTime = 1e12;      // s

std::optional<double> parse_number(std::string_view text) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !(value >= 0 && value < kLastTime))
    return std::nullopt;
  return value;
}

/// On the log's clock. A log may claim any time, so that the sum may not fit: then it is beyond every event.
std::int64_t in_log(const LogTime& time, std::int64_t first_utime) {
  if (time.since_1970) return time.us;
  std::int64_t sum = 0;
  return __builtin_add_overflow(first_utime, time.us, &sum) ? std::numeric_limits<std::int64_t>::max() : sum;
}

/// A regular expression that a whole name has to fit.
class NamePattern {
 public:
  explicit NamePattern(const std::string& text) : any_(text.empty()) {
    if (any_) return;
    compile(text, text);  // alone first: brackets must be closed within it
    ::regfree(&pattern_);
    compile("^(" + text + ")$", text);
  }
  ~NamePattern() {
    if (!any_) ::regfree(&pattern_);
  }
  NamePattern(const NamePattern&) = delete;
  NamePattern& operator=(const NamePattern&) = delete;

  bool fits(const std::string& name) const { return any_ || ::regexec(&pattern_, name.c_str(), 0, nullptr, 0) == 0; }

 private:
  void compile(const std::string& pattern, const std::string& text) {
    const int error = ::regcomp(&pattern_, pattern.c_str(), REG_EXTENDED | REG_NOSUB);
    if (error == 0) return;
    std::array<char, 100> fault{};
    ::regerror(error, &pattern_, fault.data(), fault.size());
    throw InputError("--channels " + text + ": is no regular expression: " + fault.data());
  }

  bool any_;
  regex_t pattern_{};
};

std::filesystem::path folder_of(const std::filesystem::path& file) {
  return file.has_parent_path() ? file.parent_path() : ".";
}

/// A configuration whose relative paths reach their files from the new log's folder too. One that needs no change, or
/// does not parse, stays as it is.
LogEvent moved_config(LogEvent event, const std::filesystem::path& from, const std::filesystem::path& to) {
  session_config_t message;
  DecodeCounters counters;
  if (!decode_message(event.bytes, &message, &counters)) return event;
  try {
    SessionConfig config = parse_session_config(message.yaml, "configuration", std::filesystem::absolute(from));
    bool changed = false;
    const auto move = [&](std::filesystem::path* path) {
      if (path->empty()) return;
      *path = std::filesystem::relative(*path, std::filesystem::absolute(to));
      changed = true;
    };
    move(&config.truth);
    if (config.planning) move(&config.planning->views);
    if (!changed) return event;
    message.yaml = to_yaml(config);
    event.bytes = encode_message(message);
  } catch (const InputError&) {
  }
  return event;
}

}  // namespace

std::optional<LogTime> parse_log_time(const std::string& text) {
  double seconds = 0;
  std::vector<std::string_view> words;
  for (std::string_view rest = text;;) {
    const std::size_t colon = rest.find(':');
    words.push_back(rest.substr(0, colon));
    if (colon == std::string_view::npos) break;
    rest.remove_prefix(colon + 1);
  }
  if (words.size() != 1 && words.size() != 3) return std::nullopt;
  for (std::size_t i = 0; i < words.size(); ++i) {
    const std::optional<double> number = parse_number(words[i]);
    const bool whole = i + 1 == words.size() || (number && *number == std::floor(*number));
    if (!number || !whole || (i > 0 && *number >= 60)) return std::nullopt;
    seconds = 60 * seconds + *number;
  }
  return LogTime{std::llround(seconds * 1e6), words.size() == 1 && seconds >= kFirstUnixTime};
}

CutResult cut_log(const std::filesystem::path& in, const std::filesystem::path& out, const CutOptions& options) {
  const NamePattern pattern(options.channels);
  CutResult result;
  PendingLog log(out);
  std::optional<std::int64_t> first_utime;
  std::int64_t from = 0, to = 0;
  std::optional<LogEvent> config;  // the last one before the part
  const bool moved = !std::filesystem::equivalent(folder_of(in), folder_of(out));
  const auto keep = [&](const LogEvent& event) {
    const bool move = moved && event.channel == channel::kSessionConfig;
    const LogEvent& kept = move ? moved_config(event, folder_of(in), folder_of(out)) : event;
    log.writer().write(kept.utime, kept.channel, kept.bytes);
    ++result.kept;
  };
  result.torn_bytes = scan_log(
      in,
      [&](const LogEvent& event) {
        ++result.events;
        if (!first_utime) {
          first_utime = event.utime;
          from = options.from ? in_log(*options.from, event.utime) : std::numeric_limits<std::int64_t>::min();
          to = options.to ? in_log(*options.to, event.utime) : std::numeric_limits<std::int64_t>::max();
        }
        const bool is_config = event.channel == channel::kSessionConfig;
        if (event.utime < from && is_config) config = event;
        if (event.utime < from || event.utime >= to) return;
        if (!is_config && !pattern.fits(event.channel)) return;
        if (config) keep(*std::exchange(config, std::nullopt));
        keep(event);
      },
      [&](const LogDamage&) { ++result.damaged_places; });
  if (result.kept == 0) throw InputError(in.string() + ": no event is within these times and on these channels");
  log.commit();
  return result;
}

}  // namespace vantage
