// Depth maps over a bad network: how many arrive, how fast, beside LCM's own fragments (scripts/bench link).

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <new>
#include <random>
#include <vector>

#include <CLI/CLI.hpp>
#include <lcm/lcm.h>
#include <sys/mman.h>
#include <unistd.h>

#include "calib/files/input_error.h"
#include "calib/program.h"
#include "lcmtypes/link/depth_map_receiver.h"
#include "lcmtypes/link/depth_map_sender.h"
#include "lcmtypes/link/lcm_bus.h"
#include "lcmtypes/link/sealed_bus.h"
#include "tests/lcmtypes/network/lossy_network.h"

namespace vantage {
namespace {

using std::chrono::milliseconds;

constexpr int kMostMaps = 1000;
constexpr std::int64_t kSession = 42;
constexpr std::chrono::seconds kPatience{240};
const LinkKey kKey{1, 2, 3};

struct Arguments {
  Impairment impairment;
  bool netem = false;
  int maps = 100;
  int single_maps = 20;
  int map_bytes = 400'000;
  double rate_mbit_s = 100;
};

/// What both processes see. Times are CLOCK_MONOTONIC, which all processes of a machine share.
struct Board {
  std::array<std::atomic<std::int64_t>, kMostMaps> given_ns{}, delivered_ns{};
  std::atomic<int> delivered{0}, damaged{0}, plain_delivered{0};
  std::atomic<bool> robot_done{false}, planner_ready{false};
  std::atomic<std::uint64_t> chunks{0}, chunks_again{0}, duplicates{0}, foreign{0};
};

/// A map of random bytes, which no codec makes smaller: both sides know what it must be.
depth_map_t map_of(int id, int bytes) {
  std::mt19937 random(static_cast<unsigned>(id));
  depth_map_t map{};
  map.session = kSession;
  map.map_id = id;
  const auto header = static_cast<int>(encode_message(map).size());
  map.size = std::max(bytes - header, 1);
  map.images.resize(static_cast<std::size_t>(map.size));
  for (std::uint8_t& byte : map.images) byte = static_cast<std::uint8_t>(random());
  return map;
}

std::int64_t now_ns(const Clock& clock) { return clock.monotonic().count(); }

bool wait_for(const Clock& clock, const std::function<bool()>& step) {
  const std::int64_t start = now_ns(clock);
  while (!step()) {
    if (now_ns(clock) - start > std::chrono::nanoseconds(kPatience).count()) return false;
  }
  return true;
}

int robot(const Arguments& arguments, Board& board) {
  LcmBus lcm(LossyNetwork::kUrl);
  SealedBus bus(lcm, {kKey});
  const SystemClock clock;
  DepthMapSenderOptions options;
  options.rate_bit_s = arguments.rate_mbit_s * 1e6;
  options.spool.most_bytes = std::uint64_t{1} << 30;
  DepthMapSender sender(bus, clock, options);
  const auto idle = [&] {
    sender.step();
    bus.handle(milliseconds(1));
    return sender.idle();
  };
  if (!wait_for(clock, [&] { return ::usleep(1000), board.planner_ready.load(); })) return 1;
  // One after the other: how long one takes. The last step's budget is spent first.
  int id = 0;
  for (int i = 0; i < arguments.single_maps; ++i) {
    const depth_map_t map = map_of(++id, arguments.map_bytes);
    sender.step();
    board.given_ns[static_cast<std::size_t>(id)] = now_ns(clock);
    sender.enqueue(map);
    if (!wait_for(clock, idle)) return 1;
  }
  // All at once: what gets through.
  std::vector<depth_map_t> maps;
  for (int i = 0; i < arguments.maps; ++i) maps.push_back(map_of(++id, arguments.map_bytes));
  const std::int64_t begin = now_ns(clock);
  for (const depth_map_t& map : maps) {
    board.given_ns[static_cast<std::size_t>(map.map_id)] = begin;
    sender.enqueue(map);
  }
  if (!wait_for(clock, idle)) return 1;
  // LCM alone, with its own fragments, at the same rate: what of it arrives.
  const std::unique_ptr<lcm_t, decltype(&::lcm_destroy)> plain(::lcm_create(LossyNetwork::kUrl), &::lcm_destroy);
  for (int i = 0; i < arguments.single_maps; ++i) {
    const std::vector<std::uint8_t> bytes = encode_message(map_of(i + 1, arguments.map_bytes));
    ::lcm_publish(plain.get(), "PLAIN", bytes.data(), static_cast<unsigned>(bytes.size()));
    ::usleep(static_cast<useconds_t>(8 * arguments.map_bytes / arguments.rate_mbit_s));
  }
  ::usleep(200'000);
  board.chunks = sender.chunks_sent();
  board.chunks_again = sender.chunks_sent_again();
  board.robot_done = true;
  return 0;
}

int planner(const Arguments& arguments, Board& board) {
  LcmBus lcm(LossyNetwork::kUrl);
  SealedBus bus(lcm, {kKey});
  const SystemClock clock;
  DepthMapReceiver receiver(bus, clock, [&](const depth_map_t& map) {
    const auto id = static_cast<std::size_t>(map.map_id);
    if (id >= kMostMaps || board.delivered_ns[id] != 0 ||
        encode_message(map) != encode_message(map_of(static_cast<int>(map.map_id), arguments.map_bytes))) {
      ++board.damaged;
      return;
    }
    board.delivered_ns[id] = now_ns(clock);
    ++board.delivered;
  });
  const std::unique_ptr<lcm_t, decltype(&::lcm_destroy)> plain(::lcm_create(LossyNetwork::kUrl), &::lcm_destroy);
  struct Plain {
    const Arguments& arguments;
    Board& board;
  } context{arguments, board};
  ::lcm_subscribe(
      plain.get(), "PLAIN",
      [](const lcm_recv_buf_t* received, const char*, void* user) {
        const auto& [expected, seen] = *static_cast<Plain*>(user);
        depth_map_t map;
        DecodeCounters ignored;
        const std::span bytes(static_cast<const std::uint8_t*>(received->data), received->data_size);
        if (decode_message(bytes, &map, &ignored) &&
            encode_message(map) == encode_message(map_of(static_cast<int>(map.map_id), expected.map_bytes))) {
          ++seen.plain_delivered;
        }
      },
      &context);
  board.planner_ready = true;
  while (!board.robot_done) {
    bus.handle(milliseconds(1));
    receiver.step();
    ::lcm_handle_timeout(plain.get(), 0);
  }
  board.duplicates = receiver.counters().duplicate_chunks;
  board.foreign = receiver.counters().foreign_chunks;
  return 0;
}

void report(const Arguments& arguments, const Board& board, const LossyNetwork& network) {
  std::vector<double> single_ms;
  for (int id = 1; id <= arguments.single_maps; ++id) {
    const auto at = static_cast<std::size_t>(id);
    if (board.delivered_ns[at] != 0) {
      single_ms.push_back(static_cast<double>(board.delivered_ns[at] - board.given_ns[at]) * 1e-6);
    }
  }
  std::sort(single_ms.begin(), single_ms.end());
  int delivered = 0;
  std::int64_t last = 0;
  for (int id = arguments.single_maps + 1; id <= arguments.single_maps + arguments.maps; ++id) {
    const std::int64_t at = board.delivered_ns[static_cast<std::size_t>(id)];
    delivered += at != 0 ? 1 : 0;
    last = std::max(last, at);
  }
  const auto first = static_cast<std::size_t>(arguments.single_maps + 1);
  const double seconds = static_cast<double>(last - board.given_ns[first]) * 1e-9;
  const double goodput_bit_s = 8.0 * arguments.map_bytes * delivered / seconds;
  const double left_bit_s = arguments.rate_mbit_s * 1e6 * (1 - arguments.impairment.loss);
  const Impairment& i = arguments.impairment;
  std::printf("network           loss %.0f %%, duplicates %.0f %%, overtaken %.0f %%, by %s\n", 100 * i.loss,
              100 * i.duplicate, 100 * i.reorder, arguments.netem ? "tc netem" : "our forwarder");
  std::printf("maps              %d of %d bytes at %.0f Mbit/s: %.2f s, %.1f Mbit/s arrive\n", arguments.maps,
              arguments.map_bytes, arguments.rate_mbit_s, seconds, goodput_bit_s * 1e-6);
  std::printf("chunks            %llu sent, %llu of them again; %llu came twice, %llu before their manifest\n",
              static_cast<unsigned long long>(board.chunks), static_cast<unsigned long long>(board.chunks_again),
              static_cast<unsigned long long>(board.duplicates), static_cast<unsigned long long>(board.foreign));
  if (!arguments.netem) {
    std::printf("datagrams         %llu forwarded, %llu lost\n", static_cast<unsigned long long>(network.forwarded()),
                static_cast<unsigned long long>(network.lost()));
  }
  std::printf("LCM's own way     %d of %d whole messages arrive\n", board.plain_delivered.load(),
              arguments.single_maps);
  if (board.damaged > 0) std::printf("DAMAGED           %d maps differ or came twice\n", board.damaged.load());
  std::printf("delivered %d/%d\n", delivered, arguments.maps);
  std::printf("goodput_share %.3f\n", goodput_bit_s / left_bit_s);
  std::printf("map_ms_median %.1f\n", single_ms.empty() ? 0.0 : single_ms[single_ms.size() / 2]);
}

int run(const Arguments& arguments) {
  if (arguments.maps + arguments.single_maps >= kMostMaps) throw InputError("--maps: at most 900");
  void* memory = ::mmap(nullptr, sizeof(Board), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED) throw std::bad_alloc();
  Board& board = *new (memory) Board;
  LossyNetwork network(arguments.impairment, arguments.netem ? Impairer::kNetem : Impairer::kForwarder);
  network.start(LossyNetwork::kRobot, [&] { return robot(arguments, board); });
  network.start(LossyNetwork::kPlanner, [&] { return planner(arguments, board); });
  const bool all_well = network.run();
  report(arguments, board, network);
  const bool whole = board.delivered == arguments.maps + arguments.single_maps && board.damaged == 0;
  return all_well && whole ? kExitOk : kExitFailure;
}

}  // namespace
}  // namespace vantage

int main(int argc, char** argv) {
  using namespace vantage;
  CLI::App app("Sends depth maps over a network that loses, doubles and reorders datagrams.", "scripts/bench link");
  Arguments arguments;
  Impairment& impairment = arguments.impairment;
  app.add_option("--loss", impairment.loss, "share of datagrams lost")->check(CLI::Range(0.0, 0.9));
  app.add_option("--duplicate", impairment.duplicate, "share that comes twice")->check(CLI::Range(0.0, 1.0));
  app.add_option("--reorder", impairment.reorder, "share that is overtaken; without a number 0.25")
      ->expected(0, 1)
      ->default_str("0.25")
      ->check(CLI::Range(0.0, 1.0));
  app.add_option("--seed", impairment.seed, "of the forwarder");
  app.add_flag("--netem", arguments.netem, "impair by the kernel's tc netem (scripts/vm-test has one that can)");
  app.add_option("--maps", arguments.maps, "given at once")->check(CLI::Range(1, 900))->capture_default_str();
  app.add_option("--map-bytes", arguments.map_bytes, "of each")
      ->check(CLI::Range(1000, 4 << 20))
      ->capture_default_str();
  app.add_option("--rate", arguments.rate_mbit_s, "of chunks, Mbit/s")
      ->check(CLI::Range(0.1, 1e4))
      ->capture_default_str();
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kExitOk : kExitBadInput;
  }
  return run_program("link_bench", [&] { return run(arguments); });
}
