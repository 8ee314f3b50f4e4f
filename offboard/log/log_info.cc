#include "offboard/log/log_info.h"

#include <algorithm>
#include <ctime>

#include <fmt/format.h>

#include "calib/files/input_error.h"
#include "offboard/log/known_channels.h"
#include "offboard/log/log_scan.h"
#include "offboard/session/session_config.h"

namespace vantage {
namespace {

std::string summary_of(const LogEvent& event, const std::filesystem::path& log) {
  std::string why;
  const std::optional<MessageFields> message = MessageFields::read(*find_channel(event.channel), event.bytes, &why);
  if (!message) return why;
  try {
    const SessionConfig config =
        parse_session_config(std::string(message->find("yaml")->strings().front()), "configuration", log.parent_path());
    const Eigen::Vector3d size = config.region.resolution_m * config.region.size_voxels.cast<double>();
    std::string text = fmt::format("region {:.4g} x {:.4g} x {:.4g} m at {:.4g} m", size.x(), size.y(), size.z(),
                                   config.region.resolution_m);
    if (!config.planning) return text + ", plans no views";
    return text + fmt::format(", gain {}, at most {} views", name_of(config.planning->gain),
                              config.planning->planner.most_views);
  } catch (const InputError& error) {
    return error.what();
  }
}

std::string utc(std::int64_t utime) {
  const std::int64_t second = utime / 1'000'000 - (utime % 1'000'000 < 0 ? 1 : 0);
  const auto time = static_cast<std::time_t>(second);
  std::tm parts{};
  if (::gmtime_r(&time, &parts) == nullptr) return fmt::format("{} us", utime);
  char text[40];
  std::strftime(text, sizeof text, "%Y-%m-%d %H:%M:%S", &parts);
  return fmt::format("{}.{:06} UTC", text, (utime % 1'000'000 + 1'000'000) % 1'000'000);
}

double seconds(std::int64_t from, std::int64_t to) {
  return (static_cast<double>(to) - static_cast<double>(from)) * 1e-6;
}

void extend(std::int64_t utime, bool first, std::int64_t* lowest, std::int64_t* highest) {
  *lowest = first ? utime : std::min(*lowest, utime);
  *highest = first ? utime : std::max(*highest, utime);
}

}  // namespace

LogInfo read_log_info(const std::filesystem::path& log) {
  LogInfo info;
  info.torn_bytes = scan_log(
      log,
      [&](const LogEvent& event) {
        extend(event.utime, info.events == 0, &info.first_utime, &info.last_utime);
        ++info.events;
        ChannelInfo& channel = info.channels[event.channel];
        extend(event.utime, channel.events == 0, &channel.first_utime, &channel.last_utime);
        ++channel.events;
        channel.bytes += event.bytes.size();
        const ChannelSchema* schema = find_channel(event.channel);
        if (schema != nullptr && schema->type == "session_config_t") info.config = summary_of(event, log);
      },
      [&](const LogDamage&) { ++info.damaged_places; });
  info.parts = count_log_parts(log);
  for (std::size_t part = 0; part < info.parts; ++part) info.bytes += std::filesystem::file_size(log_part(log, part));
  return info;
}

void print_log_info(const std::filesystem::path& log, const LogInfo& info, std::ostream& out) {
  out << fmt::format("{}: {} events in {} part{}, {} bytes\n", log.string(), info.events, info.parts,
                     info.parts == 1 ? "" : "s", info.bytes);
  if (info.events > 0) {
    out << fmt::format("time: {} to {}, {:.6f} s\n", utc(info.first_utime), utc(info.last_utime),
                       seconds(info.first_utime, info.last_utime));
  }
  if (!info.config.empty()) out << "session: " << info.config << '\n';
  if (info.damaged_places > 0) {
    out << fmt::format("damaged in {} place{}; `vantage-log check` names them\n", info.damaged_places,
                       info.damaged_places == 1 ? "" : "s");
  }
  if (info.torn_bytes > 0) out << fmt::format("the last {} bytes are no whole event\n", info.torn_bytes);
  std::size_t width = 7;
  for (const auto& [name, channel] : info.channels) width = std::max(width, name.size());
  out << fmt::format("{:<{}}  {:<20}  {:<7}  {:>8}  {:>9}  {:>12}  {:>12}  {:>12}\n", "channel", width, "type",
                     "version", "events", "rate_hz", "bytes", "first_s", "last_s");
  for (const auto& [name, channel] : info.channels) {
    const ChannelSchema* schema = find_channel(name);
    const double span_s = seconds(channel.first_utime, channel.last_utime);
    out << fmt::format(
        "{:<{}}  {:<20}  {:<7}  {:>8}  {:>9}  {:>12}  {:>12.6f}  {:>12.6f}\n", name, width,
        schema == nullptr ? "-" : schema->type,
        schema == nullptr   ? "unknown"
        : schema->current() ? "current"
                            : "older",
        channel.events, span_s > 0 ? fmt::format("{:.3f}", static_cast<double>(channel.events - 1) / span_s) : "-",
        channel.bytes, seconds(info.first_utime, channel.first_utime), seconds(info.first_utime, channel.last_utime));
  }
}

}  // namespace vantage
