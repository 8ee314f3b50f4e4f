#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include <vantage/status_t.hpp>

#include "lcmtypes/link/clock.h"
#include "lcmtypes/link/message_bus.h"
#include "lcmtypes/link/presence.h"

namespace vantage {

/// Says once a second what a program has counted (status_t), for people, logs and tests.
class Status {
 public:
  using Counters = std::vector<std::pair<std::string, std::int64_t>>;

  /// `collect` tells every counter by name, e.g. {"depth_maps.acknowledged", 12}. All must outlive it.
  Status(MessageBus& bus, const Clock& clock, Role role, std::int64_t boot_id, std::function<Counters()> collect);

  /// Sends the status when it is due. Call it often.
  void step();
  /// What would be sent now.
  status_t current() const;

 private:
  MessageBus& bus_;
  const Clock& clock_;
  Role role_;
  std::int64_t boot_id_;
  std::function<Counters()> collect_;
  std::chrono::nanoseconds start_, last_sent_;
};

/// The counters of a door, under `prefix`.
void add_decode_counters(const std::string& prefix, const DecodeCounters& counters, Status::Counters* all);

}  // namespace vantage
