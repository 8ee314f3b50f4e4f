#include "tests/system/link/raw_group.h"

#include <cstdio>
#include <fstream>
#include <sstream>
#include <string>
#include <utility>

#include <arpa/inet.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

namespace vantage {
namespace {

constexpr const char* kGroup = "239.255.76.67";
constexpr std::uint16_t kPort = 7667;

}  // namespace

RawGroup::RawGroup() : in_(::socket(AF_INET, SOCK_DGRAM, 0)), out_(::socket(AF_INET, SOCK_DGRAM, 0)) {
  group_.sin_family = AF_INET;
  group_.sin_port = htons(kPort);
  ::inet_pton(AF_INET, kGroup, &group_.sin_addr);
  const int one = 1;
  ::setsockopt(in_, SOL_SOCKET, SO_REUSEADDR, &one, sizeof one);
  ::setsockopt(in_, SOL_SOCKET, SO_REUSEPORT, &one, sizeof one);
  ip_mreq member{};
  member.imr_multiaddr = group_.sin_addr;
  ::bind(in_, reinterpret_cast<const sockaddr*>(&group_), sizeof group_);
  ::setsockopt(in_, IPPROTO_IP, IP_ADD_MEMBERSHIP, &member, sizeof member);
}

RawGroup::~RawGroup() {
  stop_hearing();
  ::close(out_);
}

void RawGroup::stop_hearing() {
  if (in_ >= 0) ::close(std::exchange(in_, -1));
}

bool RawGroup::receive(std::vector<std::uint8_t>* datagram) {
  pollfd polled{in_, POLLIN, 0};
  if (::poll(&polled, 1, 20) <= 0) return false;
  datagram->resize(1 << 16);
  const ssize_t size = ::recv(in_, datagram->data(), datagram->size(), 0);
  datagram->resize(size > 0 ? static_cast<std::size_t>(size) : 0);
  return size > 0;
}

void RawGroup::send(const std::vector<std::uint8_t>& datagram) {
  ::sendto(out_, datagram.data(), datagram.size(), 0, reinterpret_cast<const sockaddr*>(&group_), sizeof group_);
}

std::int64_t RawGroup::drops() {
  std::ifstream table("/proc/net/udp");
  std::string line, field;
  char port[8];
  std::snprintf(port, sizeof port, ":%04X", kPort);
  std::int64_t sum = 0;
  while (std::getline(table, line)) {
    std::istringstream fields(line);
    std::string number, local, last;
    fields >> number >> local;
    while (fields >> field) last = field;
    if (local.ends_with(port)) sum += std::stoll(last);
  }
  return sum;
}

}  // namespace vantage
