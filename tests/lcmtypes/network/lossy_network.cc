#include "tests/lcmtypes/network/lossy_network.h"

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <queue>
#include <random>
#include <stdexcept>

#include <arpa/inet.h>
#include <fmt/format.h>
#include <net/if.h>
#include <netinet/in.h>
#include <poll.h>
#include <sched.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

namespace vantage {
namespace {

using Clock = std::chrono::steady_clock;

constexpr const char* kGroup = "239.255.76.67";
constexpr std::uint16_t kPort = 7667;
constexpr int kSocketBuffer = 4 << 20;

void shell(const std::string& command) {
  if (std::system((command + " 2>/dev/null").c_str()) != 0) throw std::runtime_error("failed: " + command);
}

std::string outer(int side) { return side == LossyNetwork::kRobot ? "to_robot" : "to_planner"; }

/// Hears and speaks LCM's group on one interface, and does not hear itself.
class GroupSocket {
 public:
  explicit GroupSocket(const std::string& interface) : socket_(::socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK, 0)) {
    const int one = 1, zero = 0, buffer = kSocketBuffer;
    ::setsockopt(socket_, SOL_SOCKET, SO_REUSEADDR, &one, sizeof one);
    ::setsockopt(socket_, SOL_SOCKET, SO_RCVBUFFORCE, &buffer, sizeof buffer);
    ::setsockopt(socket_, SOL_SOCKET, SO_SNDBUFFORCE, &buffer, sizeof buffer);
    ::setsockopt(socket_, IPPROTO_IP, IP_MULTICAST_LOOP, &zero, sizeof zero);
    group_.sin_family = AF_INET;
    group_.sin_port = htons(kPort);
    ::inet_pton(AF_INET, kGroup, &group_.sin_addr);
    ip_mreqn member{};
    member.imr_multiaddr = group_.sin_addr;
    member.imr_ifindex = static_cast<int>(::if_nametoindex(interface.c_str()));
    if (::setsockopt(socket_, SOL_SOCKET, SO_BINDTODEVICE, interface.c_str(),
                     static_cast<socklen_t>(interface.size())) != 0 ||
        ::bind(socket_, reinterpret_cast<const sockaddr*>(&group_), sizeof group_) != 0 ||
        ::setsockopt(socket_, IPPROTO_IP, IP_ADD_MEMBERSHIP, &member, sizeof member) != 0 ||
        ::setsockopt(socket_, IPPROTO_IP, IP_MULTICAST_IF, &member, sizeof member) != 0) {
      throw std::runtime_error("forwarder on " + interface + ": " + std::strerror(errno));
    }
  }
  ~GroupSocket() { ::close(socket_); }
  GroupSocket(const GroupSocket&) = delete;
  GroupSocket& operator=(const GroupSocket&) = delete;

  int fd() const { return socket_; }
  bool receive(std::vector<std::uint8_t>* datagram) {
    datagram->resize(1 << 16);
    const ssize_t size = ::recv(socket_, datagram->data(), datagram->size(), 0);
    if (size < 0) return false;
    datagram->resize(static_cast<std::size_t>(size));
    return true;
  }
  void send(const std::vector<std::uint8_t>& datagram) {
    ::sendto(socket_, datagram.data(), datagram.size(), 0, reinterpret_cast<const sockaddr*>(&group_), sizeof group_);
  }

 private:
  int socket_;
  sockaddr_in group_{};
};

struct Letter {
  Clock::time_point due;
  std::uint64_t number;  // keeps the order of letters that are due at once
  int to;
  std::vector<std::uint8_t> bytes;
  bool operator<(const Letter& other) const {
    return due != other.due ? due > other.due : number > other.number;  // the earliest on top
  }
};

}  // namespace

LossyNetwork::LossyNetwork(const Impairment& impairment, Impairer impairer)
    : impairment_(impairment), impairer_(impairer) {}

LossyNetwork::~LossyNetwork() {
  for (const Child& child : children_) {
    if (child.pid <= 0) continue;
    ::kill(child.pid, SIGKILL);
    ::waitpid(child.pid, nullptr, 0);
  }
}

void LossyNetwork::start(Side side, const std::function<int()>& program) {
  int ready[2], go[2];
  if (::pipe(ready) != 0 || ::pipe(go) != 0) throw std::runtime_error("pipe failed");
  const pid_t pid = ::fork();
  if (pid < 0) throw std::runtime_error("fork failed");
  if (pid == 0) {
    int status = 1;
    char byte = 0;
    if (::unshare(CLONE_NEWNET) == 0 && ::write(ready[1], &byte, 1) == 1 && ::read(go[0], &byte, 1) == 1) {
      try {
        shell("ip link set lo up");
        shell(fmt::format("ip addr add 10.77.{}.2/24 dev link0 && ip link set link0 up", side));
        shell("ip route add 224.0.0.0/4 dev link0");
        status = program();
      } catch (const std::exception& error) {
        std::fprintf(stderr, "%s: %s\n", side == kRobot ? "robot" : "planner", error.what());
      }
    }
    std::fflush(nullptr);
    ::_exit(status);
  }
  children_[side] = {pid, go[1]};
  char byte = 0;
  const bool has_namespace = ::read(ready[0], &byte, 1) == 1;
  ::close(ready[0]);
  ::close(ready[1]);
  ::close(go[0]);
  if (!has_namespace) throw std::runtime_error("no network namespace of its own: run through scripts/private-network");
  if (impairer_ == Impairer::kForwarder) connect_side(side);
}

void LossyNetwork::connect_side(Side side) {
  shell(fmt::format("ip link add {} type veth peer name link0 netns {}", outer(side), children_[side].pid));
  shell(fmt::format("ip addr add 10.77.{}.1/24 dev {} && ip link set {} up", side, outer(side), outer(side)));
}

bool LossyNetwork::run() {
  if (impairer_ == Impairer::kNetem) {
    shell(fmt::format("ip link add link0 netns {} type veth peer name link0 netns {}", children_[0].pid,
                      children_[1].pid));
    for (const Child& child : children_) {
      shell(
          fmt::format("nsenter --net=/proc/{}/ns/net tc qdisc add dev link0 root netem limit 10000 delay {}us loss {}% "
                      "duplicate {}% {}",
                      child.pid, impairment_.delay.count() + (impairment_.reorder > 0 ? 4000 : 0),
                      100 * impairment_.loss, 100 * impairment_.duplicate,
                      impairment_.reorder > 0 ? fmt::format("reorder {}%", 100 * impairment_.reorder) : ""));
    }
  }
  for (Child& child : children_) {
    const char byte = 0;
    if (::write(child.go, &byte, 1) != 1) throw std::runtime_error("a side has ended early");
    ::close(child.go);
  }
  if (impairer_ == Impairer::kForwarder) {
    forward();
  } else {
    while (!all_ended()) ::usleep(10'000);
  }
  return all_well_;
}

bool LossyNetwork::all_ended() {
  bool ended = true;
  for (Child& child : children_) {
    int status = 0;
    if (child.pid > 0 && ::waitpid(child.pid, &status, WNOHANG) == child.pid) {
      child.pid = -1;
      all_well_ = all_well_ && WIFEXITED(status) && WEXITSTATUS(status) == 0;
    }
    ended = ended && child.pid <= 0;
  }
  return ended;
}

void LossyNetwork::forward() {
  std::array<GroupSocket, 2> sockets = {GroupSocket(outer(kRobot)), GroupSocket(outer(kPlanner))};
  std::mt19937_64 random(impairment_.seed);
  std::uniform_real_distribution<double> chance;
  std::priority_queue<Letter> under_way;
  std::vector<std::uint8_t> datagram;
  std::uint64_t number = 0;
  Clock::time_point last_look = Clock::now();
  for (;;) {
    const Clock::time_point now = Clock::now();
    if (now - last_look > std::chrono::milliseconds(10)) {
      if (all_ended()) return;
      last_look = now;
    }
    while (!under_way.empty() && under_way.top().due <= now) {
      sockets[static_cast<std::size_t>(under_way.top().to)].send(under_way.top().bytes);
      under_way.pop();
      ++forwarded_;
    }
    auto patience = std::chrono::nanoseconds(std::chrono::milliseconds(5));
    if (!under_way.empty()) patience = std::min(patience, std::chrono::nanoseconds(under_way.top().due - now));
    const timespec limit{0, std::max<long>(patience.count(), 0)};
    std::array<pollfd, 2> polled = {{{sockets[0].fd(), POLLIN, 0}, {sockets[1].fd(), POLLIN, 0}}};
    ::ppoll(polled.data(), polled.size(), &limit, nullptr);
    for (int from = 0; from < 2; ++from) {
      while (sockets[static_cast<std::size_t>(from)].receive(&datagram)) {
        if (chance(random) < impairment_.loss) {
          ++lost_;
          continue;
        }
        const int copies = chance(random) < impairment_.duplicate ? 2 : 1;
        for (int copy = 0; copy < copies; ++copy) {
          Clock::duration way = impairment_.delay;
          if (chance(random) < impairment_.reorder) {
            way += std::chrono::duration_cast<Clock::duration>(impairment_.detour * chance(random));
          }
          under_way.push({Clock::now() + way, number++, 1 - from, datagram});
        }
      }
    }
  }
}

}  // namespace vantage
