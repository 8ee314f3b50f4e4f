// Datagrams like those under way, but not quite.

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <random>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <vantage/command_t.hpp>
#include <vantage/heartbeat_t.hpp>

#include "calib/files/input_error.h"
#include "lcmtypes/link/udp_group_receiver.h"
#include "tests/system/link/link_faults.h"
#include "tests/system/link/raw_group.h"

namespace vantage {
namespace {

using Bytes = std::vector<std::uint8_t>;

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

}  // namespace

int mutate_datagrams(const FaultArguments& arguments) {
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

}  // namespace vantage
