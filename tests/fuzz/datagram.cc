#include <algorithm>
#include <cstdlib>

#include "lcmtypes/link/command_gate.h"
#include "lcmtypes/link/depth_codec.h"
#include "lcmtypes/link/depth_map_receiver.h"
#include "lcmtypes/link/depth_map_sender.h"
#include "lcmtypes/link/memory_bus.h"
#include "lcmtypes/link/presence.h"
#include "lcmtypes/link/udp_group_receiver.h"
#include "targets.h"

namespace vantage::fuzz {
namespace {

/// What is taken for a message is one: it comes out again as it went in.
template <typename Message>
void decode(Bytes bytes) {
  Message message;
  DecodeCounters counters;
  if (!decode_message(bytes, &message, &counters)) return;
  const std::vector<std::uint8_t> again = encode_message(message);
  if (!std::equal(again.begin(), again.end(), bytes.begin(), bytes.end())) std::abort();
}

void decode_as_each(Bytes bytes) {
  decode<command_t>(bytes);
  decode<depth_map_chunk_t>(bytes);
  decode<depth_map_manifest_t>(bytes);
  decode<depth_map_receipt_t>(bytes);
  decode<heartbeat_t>(bytes);
  decode<key_pose_t>(bytes);
  decode<motion_goal_t>(bytes);
  decode<preview_t>(bytes);
  decode<robot_state_t>(bytes);
  decode<session_config_t>(bytes);
  decode<status_t>(bytes);
  decode<trajectory_t>(bytes);
  depth_map_t map;
  DecodeCounters counters;
  std::string why;
  if (bytes.size() > (1 << 16) || !decode_message(bytes, &map, &counters)) return;
  if (std::int64_t{map.width} * map.height > 1 << 16) return;  // a small claim can unpack to 200 MB, as it says
  if (const auto unpacked = unpack_depth_map(map, &why); unpacked && !unpacked->valid(&why)) std::abort();
}

}  // namespace

void datagram(Bytes input) {
  ManualClock clock;
  MemoryBus bus;
  DepthMapReceiver receiver(bus, clock, [](const depth_map_t&) {}, {.most_total_bytes = 1 << 20});
  DepthMapSender sender(bus, clock);
  Presence presence(bus, clock, Role::kPlanner, "1");
  CommandGate gate(1);
  DecodeCounters counters;
  subscribe_message<command_t>(bus, channel::kCommand, &counters, [&](const command_t& command) {
    const std::int64_t before = gate.counter();
    const bool stop = command.kind == static_cast<std::int8_t>(CommandKind::kStop);
    if (gate.admit(command, clock.utime()) && !stop && gate.counter() <= before) std::abort();
  });
  while (input.size() >= 2) {
    const std::size_t size = std::min(std::size_t{input[0]} | std::size_t{input[1]} << 8, input.size() - 2);
    const LcmDatagram parsed = parse_lcm_datagram(input.subspan(2, size));
    input = input.subspan(2 + size);
    if (parsed.channel.empty()) continue;
    decode_as_each(parsed.bytes);
    bus.publish(parsed.channel, parsed.bytes);
    clock.advance(std::chrono::milliseconds(20));
    for (int i = 0; i < 20 && bus.handle(std::chrono::milliseconds(0)); ++i) {
    }
    receiver.step();
    sender.step();
  }
}

}  // namespace vantage::fuzz
