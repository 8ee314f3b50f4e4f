// The fuzz targets without libFuzzer: seeds, and some thousand random changes of them, in every build.

#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "lcmtypes/link/command_sender.h"
#include "lcmtypes/link/depth_codec.h"
#include "lcmtypes/link/depth_map_receiver.h"
#include "lcmtypes/link/depth_map_sender.h"
#include "lcmtypes/link/memory_bus.h"
#include "lcmtypes/link/status.h"
#include "targets.h"
#include "tests/lcmtypes/sample_depth_map.h"

namespace vantage::fuzz {
namespace {

using Input = std::vector<std::uint8_t>;

Input file(const std::string& name) {
  std::ifstream stream(VANTAGE_SOURCE_DIR "/calib/rigs/" + name, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

/// Changes, drops, doubles and moves bytes and stretches.
Input changed(Input input, std::mt19937& random) {
  const std::size_t changes = 1 + random() % 4;
  for (std::size_t i = 0; i < changes && !input.empty(); ++i) {
    const std::size_t at = random() % input.size(), length = std::min(input.size() - at, 1 + random() % 40);
    const auto first = input.begin() + static_cast<std::ptrdiff_t>(at);
    const Input stretch(first, first + static_cast<std::ptrdiff_t>(length));
    switch (random() % 4) {
      case 0:
        input[at] = static_cast<std::uint8_t>(random());
        break;
      case 1:
        input.erase(first, first + static_cast<std::ptrdiff_t>(length));
        break;
      case 2:
        input.insert(first, stretch.begin(), stretch.end());
        break;
      default:
        input.insert(input.begin() + static_cast<std::ptrdiff_t>(random() % input.size()), stretch.begin(),
                     stretch.end());
    }
  }
  return input;
}

void run(void (*target)(Bytes), const Input& seed, int rounds) {
  const unsigned seed_number = 6;
  testing::Test::RecordProperty("seed", static_cast<int>(seed_number));
  std::mt19937 random(seed_number);
  target({});
  target(seed);
  for (int i = 0; i < rounds; ++i) target(changed(seed, random));
}

/// What both sides of the link say while a depth map crosses it.
Input conversation() {
  Input all;
  MemoryBus bus;
  ManualClock clock;
  const auto hear = [&](const char* channel) {
    bus.subscribe(channel, [&all, channel](Bytes bytes) {
      const std::string head = std::string("LC02") + std::string(4, '\0') + channel + std::string(1, '\0');
      const std::size_t size = head.size() + bytes.size();
      all.push_back(static_cast<std::uint8_t>(size));
      all.push_back(static_cast<std::uint8_t>(size >> 8));
      all.insert(all.end(), head.begin(), head.end());
      all.insert(all.end(), bytes.begin(), bytes.end());
    });
  };
  for (const char* channel : {channel::kHeartbeat, channel::kDepthManifest, channel::kDepthChunk,
                              channel::kDepthReceipt, channel::kCommand, channel::kStatus}) {
    hear(channel);
  }
  Presence robot(bus, clock, Role::kRobot, "1"), planner(bus, clock, Role::kPlanner, "1");
  CommandSender commands(bus, clock, planner);
  Status status(bus, clock, Role::kRobot, 1, [] { return Status::Counters{{"a.counter", 1}}; });
  DepthMapReceiver receiver(bus, clock, [](const depth_map_t&) {});
  DepthMapSender sender(bus, clock);
  sender.enqueue(pack_depth_map(sample_depth_map(32, 24)));
  for (int t = 0; t < 11; ++t) {
    clock.advance(std::chrono::milliseconds(100));
    robot.step();
    planner.step();
    sender.step();
    receiver.step();
    status.step();
    if (t % 5 == 0) commands.send(CommandKind::kPause);
    while (bus.handle(std::chrono::milliseconds(0))) {
    }
  }
  return all;
}

Input random_bytes(std::size_t size) {
  std::mt19937 random(8);
  Input bytes(size);
  for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random());
  return bytes;
}

TEST(Fuzz, CanFrames) { run(can_frame, random_bytes(160), 5000); }
TEST(Fuzz, Datagrams) {
  const Input seed = conversation();
  ASSERT_GT(seed.size(), 2000u);
  run(datagram, seed, 2000);
}
TEST(Fuzz, Sdo) {
  for (std::uint8_t kind = 0; kind < 3; ++kind) {
    Input seed = random_bytes(200);
    seed[0] = kind;
    run(sdo, seed, 300);
  }
}
TEST(Fuzz, Eds) { run(eds, file("simulated_drive.eds"), 300); }
TEST(Fuzz, Rig) { run(rig, file("youbot.yaml"), 300); }

}  // namespace
}  // namespace vantage::fuzz
