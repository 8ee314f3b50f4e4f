// What is acknowledged on the network, and what of it a planner's log holds.

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <map>
#include <set>
#include <utility>

#include <vantage/status_t.hpp>

#include "calib/files/input_error.h"
#include "calib/program.h"
#include "lcmtypes/link/digest.h"
#include "lcmtypes/link/event_log.h"
#include "lcmtypes/link/lcm_bus.h"
#include "lcmtypes/link/sealed_bus.h"
#include "tests/system/link/link_faults.h"

namespace vantage {

int witness_acknowledgements(const FaultArguments& arguments) {
  LcmBus lcm;
  SealedBus bus(lcm, {read_link_key(arguments.key)});
  std::ofstream out(arguments.file);
  DecodeCounters decode;
  subscribe_message<depth_map_receipt_t>(bus, channel::kDepthReceipt, &decode, [&](const depth_map_receipt_t& receipt) {
    if (receipt.complete == 0) return;
    out << receipt.session << ' ' << receipt.map_id;
    for (const std::uint8_t byte : receipt.digest) out << ' ' << static_cast<int>(byte);
    out << std::endl;
  });
  const std::atomic<bool>& interrupted = interrupt_flag();
  while (!interrupted) bus.handle(std::chrono::milliseconds(20));
  return kExitOk;
}

/// All that was acknowledged must be in the log, whole, but what the planner counted as refused (answers to a goal that
/// had its map); nothing may be there twice.
int verify_acknowledgements(const FaultArguments& arguments) {
  std::map<std::pair<std::int64_t, std::int64_t>, Digest> logged;
  int twice = 0;
  std::int64_t refused = 0;
  LogReader reader(arguments.log);
  for (LogEvent event; reader.next(&event);) {
    depth_map_t map;
    status_t status;
    DecodeCounters decode;
    if (event.channel == channel::kDepthMap && decode_message(event.bytes, &map, &decode)) {
      twice += logged.insert({{map.session, map.map_id}, digest_of(event.bytes)}).second ? 0 : 1;
    }
    if (event.channel != channel::kStatus || !decode_message(event.bytes, &status, &decode)) continue;
    for (std::size_t i = 0; i < status.name.size(); ++i) {
      if (status.name[i] == "depth_maps.refused") refused = status.value[i];
    }
  }
  std::set<std::pair<std::int64_t, std::int64_t>> acknowledged;
  int missing = 0, differ = 0;
  std::ifstream in(arguments.file);
  for (std::int64_t session = 0, map_id = 0; in >> session >> map_id;) {
    Digest digest{};
    for (std::uint8_t& byte : digest) {
      int value = 0;
      in >> value;
      byte = static_cast<std::uint8_t>(value);
    }
    if (!acknowledged.insert({session, map_id}).second) continue;
    const auto found = logged.find({session, map_id});
    missing += found == logged.end() ? 1 : 0;
    differ += found != logged.end() && found->second != digest ? 1 : 0;
  }
  const std::int64_t lost = std::max<std::int64_t>(missing - refused, 0) + differ;
  std::printf(
      "%zu maps acknowledged, %zu taken, %lld refused as answers to a goal that had its map, %lld lost, %d taken "
      "twice\n",
      acknowledged.size(), logged.size(), static_cast<long long>(refused), static_cast<long long>(lost), twice);
  return lost == 0 && twice == 0 && !acknowledged.empty() ? kExitOk : kExitFailure;
}

}  // namespace vantage
