#include "offboard/log/log_maps.h"

#include "calib/files/input_error.h"
#include "offboard/log/depth_map_gatherer.h"
#include "offboard/log/log_scan.h"

namespace vantage {

void for_each_depth_map(const std::filesystem::path& log, const std::function<void(const DepthMap&)>& on_map) {
  DepthMapGatherer maps;
  scan_whole_log(log, [&](const LogEvent& event) {
    const ChannelSchema* schema = find_channel(event.channel);
    if (schema == nullptr || !schema->type.starts_with("depth_map_")) return;
    std::string fault;
    const std::optional<MessageFields> message = MessageFields::read(*schema, event.bytes, &fault);
    std::optional<DepthMap> map;
    if (message) map = maps.take(event, *message, "", &fault);
    if (!fault.empty()) throw InputError(place_of(log, event) + fault);
    if (map) on_map(*map);
  });
}

}  // namespace vantage
