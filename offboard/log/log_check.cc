#include "offboard/log/log_check.h"

#include "calib/files/input_error.h"
#include "offboard/log/depth_map_gatherer.h"
#include "offboard/log/known_channels.h"
#include "offboard/log/log_scan.h"
#include "offboard/session/session_config.h"

namespace vantage {

LogCheck check_log(const std::filesystem::path& log, std::ostream& out) {
  LogCheck check;
  DepthMapGatherer maps;
  const auto report = [&](const std::string& fault) {
    ++check.faults;
    out << fault << '\n';
  };
  const auto check_event = [&](const LogEvent& event) {
    ++check.events;
    const ChannelSchema* schema = find_channel(event.channel);
    if (schema == nullptr) {
      ++check.unknown;
      return;
    }
    const std::string place = place_of(log, event);
    std::string fault;
    const std::optional<MessageFields> message = MessageFields::read(*schema, event.bytes, &fault);
    if (!message) return report(place + fault);
    if (schema->type == "session_config_t") {
      try {
        parse_session_config(std::string(message->find("yaml")->strings().front()), "configuration", log.parent_path());
      } catch (const InputError& error) {
        report(place + error.what());
      }
    }
    const std::optional<DepthMap> map = maps.take(event, *message, place, &fault);
    if (!fault.empty()) report(place + fault);
    if (map && schema->type == "depth_map_t") ++check.whole_maps;
  };
  const std::uint64_t torn = scan_log(log, check_event, [&](const LogDamage& damage) {
    report(damage.fault + " (" + std::to_string(damage.passed_bytes) + " bytes to the next whole event)");
  });
  if (torn > 0) {
    const std::filesystem::path part = log_part(log, count_log_parts(log) - 1);
    report(part.string() + ": at byte " + std::to_string(std::filesystem::file_size(part) - torn) +
           ": the log ends within an event (" + std::to_string(torn) + " bytes of it)");
  }
  for (const DepthMapGatherer::Incomplete& map : maps.incomplete()) {
    report(map.place + "depth map " + std::to_string(map.map_id) + ": " + std::to_string(map.missing) + " of " +
           std::to_string(map.chunks) + " chunks are missing");
  }
  check.maps_in_chunks = maps.assembled();
  check.foreign_chunks = maps.foreign_chunks();
  return check;
}

}  // namespace vantage
