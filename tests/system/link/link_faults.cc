// What somebody on the network may try against two running programs, and a witness of what they acknowledge:
// scripts/test-link-faults.

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <map>
#include <random>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include <CLI/CLI.hpp>
#include <vantage/robot_state_t.hpp>

#include "calib/files/input_error.h"
#include "calib/program.h"
#include "lcmtypes/link/command_gate.h"
#include "lcmtypes/link/digest.h"
#include "lcmtypes/link/event_log.h"
#include "lcmtypes/link/lcm_bus.h"
#include "lcmtypes/link/presence.h"
#include "lcmtypes/link/sealed_bus.h"
#include "lcmtypes/link/udp_group_receiver.h"
#include "tests/system/link/raw_group.h"

namespace vantage {
namespace {

using std::chrono::milliseconds;
using Bytes = std::vector<std::uint8_t>;

struct Arguments {
  std::string key, file, log;
  int count = 10'000;
  std::vector<int> pids;
  unsigned seed = 1;
};

/// The latest status and state of the robot, as anyone with the key hears them.
class RobotWatch {
 public:
  RobotWatch(MessageBus& bus, const Clock& clock) : presence_(bus, clock, Role::kPlanner, "watch") {
    subscribe_message<status_t>(bus, channel::kStatus, &decode_, [this](const status_t& status) {
      if (status.role != static_cast<std::int8_t>(Role::kRobot)) return;
      for (std::size_t i = 0; i < status.name.size(); ++i) counters_[status.name[i]] = status.value[i];
      ++statuses_;
    });
    subscribe_message<robot_state_t>(bus, channel::kRobotState, &decode_, [this](const robot_state_t& state) {
      states_.insert({state.goal_id, state.activity});
    });
  }
  const Presence& presence() const { return presence_; }
  std::int64_t counter(const std::string& name) const {
    const auto found = counters_.find(name);
    return found == counters_.end() ? 0 : found->second;
  }
  int statuses() const { return statuses_; }
  /// Every pair of goal and activity that was seen since the last call.
  std::set<std::pair<std::int64_t, int>> take_states() { return std::exchange(states_, {}); }

 private:
  Presence presence_;
  DecodeCounters decode_;
  std::map<std::string, std::int64_t> counters_;
  std::set<std::pair<std::int64_t, int>> states_;
  int statuses_ = 0;
};

void listen(MessageBus& bus, milliseconds duration) {
  const auto end = std::chrono::steady_clock::now() + duration;
  while (std::chrono::steady_clock::now() < end) bus.handle(milliseconds(5));
}

// --- witness: writes down every acknowledgement, a line each, until it is ended.

int witness(const Arguments& arguments) {
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
  while (!interrupted) bus.handle(milliseconds(20));
  return kExitOk;
}

// --- verify: every acknowledged map is in the planner's log, whole, but those that it counted as refused (they answer
// a goal that had its map); none is there twice.

int verify(const Arguments& arguments) {
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

// --- forge: commands that must not be obeyed.

/// Lets what goes through pass on as it is, and keeps a copy.
Bytes sealed_as(const LinkKey& key, const char* channel, const Bytes& bytes) {
  class Keeper final : public MessageBus {
   public:
    void publish(std::string_view, std::span<const std::uint8_t> b) override { kept.assign(b.begin(), b.end()); }
    void subscribe(std::string_view, Handler) override {}
    bool handle(milliseconds) override { return false; }
    Bytes kept;
  } keeper;
  SealedBus(keeper, {key}).publish(channel, bytes);
  return keeper.kept;
}

Bytes command_bytes(std::int64_t robot, std::int64_t counter, std::int64_t expires, const Bytes& goal) {
  command_t command{};
  command.robot = robot;
  command.counter = counter;
  command.expires = expires;
  command.size = static_cast<std::int32_t>(goal.size());
  command.payload = goal;
  return encode_message(command);
}

int forge(const Arguments& arguments) {
  const LinkKey key = read_link_key(arguments.key);
  const SystemClock clock;
  LcmBus lcm;
  SealedBus bus(lcm, {key});
  RobotWatch robot(bus, clock);
  std::vector<Bytes> captured;
  auto last_command = std::chrono::steady_clock::now();
  lcm.subscribe(channel::kCommand, [&](std::span<const std::uint8_t> bytes) {
    captured.emplace_back(bytes.begin(), bytes.end());
    last_command = std::chrono::steady_clock::now();
  });
  // The planner speaks, and is gone: what comes after is ours.
  const auto begin = std::chrono::steady_clock::now();
  while (captured.size() < 2 || std::chrono::steady_clock::now() - last_command < std::chrono::seconds(3)) {
    bus.handle(milliseconds(20));
    if (std::chrono::steady_clock::now() - begin > std::chrono::seconds(60)) {
      throw InputError("no planner commanded within 60 s, or it goes on");
    }
  }
  const std::vector<Bytes> genuine = std::exchange(captured, {});
  listen(bus, milliseconds(2500));
  robot.take_states();
  const std::int64_t accepted = robot.counter("commands.accepted");
  const auto refused = [&] {
    return robot.counter("commands.not_rising") + robot.counter("commands.expired") +
           robot.counter("commands.other_robot") + robot.counter("commands.too_long") +
           robot.counter("commands.unknown_kind") + robot.counter("seals.refused") +
           robot.counter("door.commands.wrong_type") + robot.counter("door.commands.wrong_size");
  };
  const std::int64_t refused_before = refused();
  const std::int64_t boot_id = robot.presence().peer_boot_id();

  command_t last;
  DecodeCounters decode;
  const Bytes& newest = genuine.back();
  if (!decode_message(std::span(newest).first(newest.size() - SealedBus::kSealBytes), &last, &decode)) {
    throw InputError("the captured command does not decode");
  }
  motion_goal_t goal;
  if (!decode_message(last.payload, &goal, &decode)) throw InputError("the captured goal does not decode");
  goal.goal_id += 1000;
  const Bytes goal_bytes = encode_message(goal);
  std::mt19937 random(arguments.seed);
  const LinkKey foreign = make_link_key();
  const std::array<const char*, 9> names = {
      "replayed",           "one bit changed", "foreign key",       "no seal",       "sealed for another channel",
      "counter not rising", "expired",         "for another start", "valid too long"};
  std::array<int, 9> sent{};
  for (int i = 0; i < arguments.count; ++i) {
    const std::int64_t soon = *robot.presence().peer_utime() + 1'000'000;
    const std::int64_t next = last.counter + 1 + i;
    const auto kind = static_cast<std::size_t>(i) % names.size();
    Bytes bytes = genuine[random() % genuine.size()];
    switch (kind) {
      case 0:
        break;
      case 1:
        bytes[random() % bytes.size()] ^= static_cast<std::uint8_t>(1u << random() % 8);
        break;
      case 2:
        bytes = sealed_as(foreign, channel::kCommand, command_bytes(boot_id, next, soon, goal_bytes));
        break;
      case 3:
        bytes = command_bytes(boot_id, next, soon, goal_bytes);
        break;
      case 4:
        bytes = sealed_as(key, channel::kRobotState, command_bytes(boot_id, next, soon, goal_bytes));
        break;
      case 5:
        bytes = sealed_as(key, channel::kCommand, command_bytes(boot_id, last.counter, soon, goal_bytes));
        break;
      case 6:
        bytes = sealed_as(key, channel::kCommand, command_bytes(boot_id, next, soon - 2'000'000, goal_bytes));
        break;
      case 7:
        bytes = sealed_as(key, channel::kCommand, command_bytes(boot_id ^ 1, next, soon, goal_bytes));
        break;
      case 8:
        bytes = sealed_as(key, channel::kCommand, command_bytes(boot_id, next, soon + 60'000'000, goal_bytes));
        break;
    }
    lcm.publish(channel::kCommand, bytes);
    ++sent[kind];
    while (bus.handle(milliseconds(0))) {
    }
    if (i % 16 == 0) std::this_thread::sleep_for(milliseconds(2));  // so that none is lost on the way
  }
  listen(bus, milliseconds(2500));
  const std::int64_t newly_accepted = robot.counter("commands.accepted") - accepted;
  const std::int64_t newly_refused = refused() - refused_before;
  const auto states = robot.take_states();
  std::printf("forgeries %d:", arguments.count);
  for (std::size_t i = 0; i < names.size(); ++i) std::printf("%s %d %s", i == 0 ? "" : ",", sent[i], names[i]);
  std::printf("; refused %lld, accepted %lld\n", static_cast<long long>(newly_refused),
              static_cast<long long>(newly_accepted));
  const bool moved = std::any_of(states.begin(), states.end(),
                                 [&](const auto& state) { return state.first == goal.goal_id || state.second == 1; });
  if (moved) std::printf("the robot MOVED\n");
  const bool arrived = newly_refused >= arguments.count * 99LL / 100;
  if (!arrived) std::printf("too few arrived to tell\n");
  return newly_accepted == 0 && !moved && arrived ? kExitOk : kExitFailure;
}

// --- mutate: datagrams like those under way, but not quite, against robot and planner.

std::int64_t resident_kb(int pid) {
  std::ifstream status("/proc/" + std::to_string(pid) + "/status");
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with("VmRSS:")) return std::stoll(line.substr(6));
  }
  return -1;
}

Bytes mutated(const std::vector<Bytes>& corpus, std::mt19937& random) {
  Bytes bytes = corpus[random() % corpus.size()];
  const auto place = [&] { return static_cast<std::size_t>(random() % bytes.size()); };
  for (unsigned left = 1 + random() % 4; left > 0 && !bytes.empty(); --left) {
    switch (random() % 8) {
      case 0:
        bytes[place()] ^= static_cast<std::uint8_t>(1u << random() % 8);
        break;
      case 1:
        bytes[place()] = static_cast<std::uint8_t>(random());
        break;
      case 2:  // a length, an offset or a count that claims much, or less than nothing
        if (bytes.size() >= 4) {
          constexpr std::array<std::uint32_t, 7> kClaims = {0,          1,          0x7fffffff, 0x80000000,
                                                            0xffffffff, 0x10000000, 0x0000ffff};
          const std::uint32_t claim = kClaims[random() % kClaims.size()];
          const std::size_t at = random() % (bytes.size() - 3);
          for (std::size_t i = 0; i < 4; ++i) bytes[at + i] = static_cast<std::uint8_t>(claim >> (24 - 8 * i));
        }
        break;
      case 3:
        bytes.resize(place());
        break;
      case 4:
        bytes.resize(std::min<std::size_t>(bytes.size() + random() % 2000, 60'000),
                     static_cast<std::uint8_t>(random()));
        break;
      case 5: {  // the head of one, the tail of another
        const Bytes& other = corpus[random() % corpus.size()];
        const std::size_t at = place();
        bytes.resize(at);
        if (at < other.size()) bytes.insert(bytes.end(), other.begin() + static_cast<std::ptrdiff_t>(at), other.end());
        break;
      }
      case 6:  // LCM's header for fragments before it
        bytes.insert(bytes.begin() + std::min<std::ptrdiff_t>(8, static_cast<std::ptrdiff_t>(bytes.size())), 12,
                     static_cast<std::uint8_t>(random() % 4));
        bytes[std::min<std::size_t>(3, bytes.size() - 1)] = '3';
        break;
      case 7:
        std::swap(bytes[place()], bytes[place()]);
        break;
    }
  }
  return bytes;
}

/// True when a mutation is a sound heartbeat or command all the same. On an insecure network such a sentence is
/// somebody's word, which is believed: it shows nothing to try it.
bool is_somebodys_word(const Bytes& bytes) {
  const LcmDatagram parsed = parse_lcm_datagram(bytes);
  DecodeCounters ignored;
  heartbeat_t heartbeat;
  command_t command;
  return (parsed.channel == channel::kHeartbeat && decode_message(parsed.bytes, &heartbeat, &ignored)) ||
         (parsed.channel == channel::kCommand && decode_message(parsed.bytes, &command, &ignored));
}

int mutate(const Arguments& arguments) {
  const bool sealed = !arguments.key.empty();
  std::vector<Bytes> corpus;
  {
    RawGroup group;
    for (const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(4);
         std::chrono::steady_clock::now() < end;) {
      if (Bytes datagram; group.receive(&datagram)) corpus.push_back(std::move(datagram));
    }
  }
  if (corpus.size() < 20) throw InputError("hardly anything was said within 4 s");
  RawGroup group;
  group.stop_hearing();
  std::mt19937 random(arguments.seed);
  std::vector<std::int64_t> before;
  const std::int64_t drops_before = RawGroup::drops();
  for (int i = 0; i < arguments.count; ++i) {
    Bytes bytes = mutated(corpus, random);
    while (!sealed && is_somebodys_word(bytes)) bytes = mutated(corpus, random);
    group.send(bytes);
    if (i % 8 == 0) std::this_thread::sleep_for(std::chrono::microseconds(200));
    if (i == arguments.count / 10) {  // by then buffers and pools have their size
      for (const int pid : arguments.pids) before.push_back(resident_kb(pid));
    }
  }
  std::this_thread::sleep_for(std::chrono::seconds(1));
  const std::int64_t dropped = RawGroup::drops() - drops_before;
  std::printf("mutations %d, of %zu kinds of datagram: %lld not taken off the sockets in time", arguments.count,
              corpus.size(), static_cast<long long>(dropped));
  bool well = true;
  for (std::size_t i = 0; i < arguments.pids.size(); ++i) {
    const std::int64_t now = resident_kb(arguments.pids[i]);
    if (now < 0) {
      std::printf("; process %zu has DIED", i);
      well = false;
      continue;
    }
    std::printf("; process %zu: %lld kB, %+lld kB over the last nine tenths", i, static_cast<long long>(now),
                static_cast<long long>(now - before[i]));
    well = well && now - before[i] < 8'192;
  }
  std::printf("\n");
  return well ? kExitOk : kExitFailure;
}

}  // namespace
}  // namespace vantage

int main(int argc, char** argv) {
  using namespace vantage;
  CLI::App app("Attacks on two running programs, and a witness of what they acknowledge.", "link_faults");
  Arguments arguments;
  int (*chosen)(const Arguments&) = nullptr;
  const auto add = [&](const char* name, int (*what)(const Arguments&)) {
    CLI::App* sub = app.add_subcommand(name);
    sub->callback([&chosen, what] { chosen = what; });
    sub->add_option("--key", arguments.key, "the programs' key");
    sub->add_option("--file", arguments.file, "of acknowledgements");
    sub->add_option("--log", arguments.log, "of the planner's session");
    sub->add_option("--count", arguments.count, "of forgeries or mutations")->check(CLI::PositiveNumber);
    sub->add_option("--pids", arguments.pids, "whose memory is watched");
    sub->add_option("--seed", arguments.seed);
  };
  add("witness", &witness);
  add("verify", &verify);
  add("forge", &forge);
  add("mutate", &mutate);
  app.require_subcommand(1);
  CLI11_PARSE(app, argc, argv);
  return run_program("link_faults", [&] { return chosen(arguments); });
}
