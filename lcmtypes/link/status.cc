#include "lcmtypes/link/status.h"

namespace vantage {
namespace {

constexpr std::chrono::seconds kPeriod{1};

}  // namespace

Status::Status(MessageBus& bus, const Clock& clock, Role role, std::int64_t boot_id, std::function<Counters()> collect)
    : bus_(bus),
      clock_(clock),
      role_(role),
      boot_id_(boot_id),
      collect_(std::move(collect)),
      start_(clock.monotonic()),
      last_sent_(start_) {}

void Status::step() {
  const std::chrono::nanoseconds now = clock_.monotonic();
  if (now - last_sent_ < kPeriod) return;
  last_sent_ = now;
  publish_message(bus_, channel::kStatus, current());
}

status_t Status::current() const {
  status_t status;
  status.utime = clock_.utime();
  status.boot_id = boot_id_;
  status.role = static_cast<std::int8_t>(role_);
  status.uptime = std::chrono::duration_cast<std::chrono::microseconds>(clock_.monotonic() - start_).count();
  for (auto& [name, value] : collect_()) {
    status.name.push_back(std::move(name));
    status.value.push_back(value);
  }
  status.counters = static_cast<std::int32_t>(status.name.size());
  return status;
}

void add_decode_counters(const std::string& prefix, const DecodeCounters& counters, Status::Counters* all) {
  all->emplace_back(prefix + ".accepted", counters.accepted);
  all->emplace_back(prefix + ".wrong_type", counters.wrong_type);
  all->emplace_back(prefix + ".wrong_size", counters.wrong_size);
  all->emplace_back(prefix + ".malformed", counters.malformed);
}

}  // namespace vantage
