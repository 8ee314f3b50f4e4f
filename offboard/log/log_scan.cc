#include "offboard/log/log_scan.h"

#include <optional>
#include <system_error>
#include <utility>

#include "calib/files/input_error.h"
#include "offboard/session/session_folder.h"

namespace vantage {

namespace fs = std::filesystem;

fs::path log_of(const fs::path& file_or_folder) {
  std::error_code ignored;
  if (!fs::is_directory(file_or_folder, ignored)) return file_or_folder;
  fs::path log = SessionFolder{file_or_folder}.log();
  if (!fs::exists(log, ignored)) throw InputError(file_or_folder.string() + ": holds no session (no log.lcm)");
  return log;
}

std::uint64_t scan_log(const fs::path& log, const std::function<void(const LogEvent&)>& on_event,
                       const std::function<void(const LogDamage&)>& on_damage) {
  LogReader reader(log, {.accept_torn_end = true});
  std::optional<std::pair<std::size_t, std::uint64_t>> last_damage;  // part and byte
  bool any_event = false;
  for (LogEvent event;;) {
    std::optional<LogDamage> damage;
    try {
      if (!reader.next(&event)) break;
    } catch (const InputError& error) {
      const std::pair here(reader.part(), reader.offset());
      damage = LogDamage{error.what(), reader.skip_damage()};
      const bool no_log = !any_event && reader.at_end_of_part() && reader.part() == 0;
      if (no_log || last_damage == here) throw;  // the latter: the file can't be read
      last_damage = here;
    }
    if (damage) {
      on_damage(*damage);
    } else {
      any_event = true;
      on_event(event);
    }
  }
  return reader.torn_bytes();
}

std::uint64_t scan_whole_log(const fs::path& log, const std::function<void(const LogEvent&)>& on_event) {
  return scan_log(log, on_event, [](const LogDamage& damage) {
    throw InputError(damage.fault + "; `vantage-log cut` makes a log of what is whole");
  });
}

std::string place_of(const fs::path& log, const LogEvent& event) {
  return log_part(log, event.part).string() + ": event " + std::to_string(event.number) + ", byte " +
         std::to_string(event.offset) + ": " + event.channel + ": ";
}

}  // namespace vantage
