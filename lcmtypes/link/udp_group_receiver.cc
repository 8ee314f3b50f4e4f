#include "lcmtypes/link/udp_group_receiver.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include "calib/files/input_error.h"

namespace vantage {
namespace {

constexpr std::uint32_t kMessageMagic = 0x4c433032, kFragmentMagic = 0x4c433033;  // "LC02", "LC03"
constexpr std::size_t kHeaderBytes = 8;                                           // magic, sequence number
constexpr std::size_t kMostChannelBytes = 63;                                     // LCM_MAX_CHANNEL_NAME_LENGTH
constexpr std::size_t kMostQueuedBytes = 16 << 20;
constexpr std::size_t kMostQueuedLetters = 16384;
constexpr std::size_t kLettersAtOnce = 64;  // then the caller may do what else is due
constexpr std::size_t kDatagramsAtOnce = 32;
constexpr std::size_t kDatagramBytes = 1 << 16;

}  // namespace

LcmDatagram parse_lcm_datagram(std::span<const std::uint8_t> datagram) {
  if (datagram.size() < kHeaderBytes) return {};
  const std::uint32_t magic = std::uint32_t{datagram[0]} << 24 | std::uint32_t{datagram[1]} << 16 |
                              std::uint32_t{datagram[2]} << 8 | std::uint32_t{datagram[3]};
  if (magic == kFragmentMagic) return {{}, {}, true};
  if (magic != kMessageMagic) return {};
  const std::span<const std::uint8_t> rest = datagram.subspan(kHeaderBytes);
  const auto limit = rest.begin() + static_cast<std::ptrdiff_t>(std::min(rest.size(), kMostChannelBytes + 1));
  const auto end = std::find(rest.begin(), limit, 0);
  if (end == limit || end == rest.begin()) return {};
  const auto length = static_cast<std::size_t>(end - rest.begin());
  return {{reinterpret_cast<const char*>(rest.data()), length}, rest.subspan(length + 1)};
}

UdpGroupReceiver::UdpGroupReceiver(in_addr group, std::uint16_t port, int socket_buffer_bytes)
    : socket_(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0)), stop_(::eventfd(0, EFD_CLOEXEC)) {
  const auto set = [&](int level, int option, const auto& value) {
    return ::setsockopt(socket_.get(), level, option, &value, sizeof value) == 0;
  };
  if (!set(SOL_SOCKET, SO_RCVBUFFORCE, socket_buffer_bytes)) set(SOL_SOCKET, SO_RCVBUF, socket_buffer_bytes);
  set(SOL_SOCKET, SO_RXQ_OVFL, 1);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr = group;
  const ip_mreq member{group, {htonl(INADDR_ANY)}};
  if (!set(SOL_SOCKET, SO_REUSEADDR, 1) ||
      ::bind(socket_.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 ||
      !set(IPPROTO_IP, IP_ADD_MEMBERSHIP, member)) {
    throw InputError("LCM's multicast group can't be joined on port " + std::to_string(port) + ": " +
                     std::strerror(errno));
  }
  thread_ = std::thread([this] { listen(); });
}

UdpGroupReceiver::~UdpGroupReceiver() {
  const std::uint64_t one = 1;
  [[maybe_unused]] const ssize_t written = ::write(stop_.get(), &one, sizeof one);
  thread_.join();
}

void UdpGroupReceiver::subscribe(std::string_view channel, MessageBus::Handler handler) {
  handlers_.emplace(std::string(channel), std::move(handler));
  const std::lock_guard lock(mutex_);
  ++wanted_[std::string(channel)];
}

void UdpGroupReceiver::listen() {
  struct Slot {
    alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(std::uint32_t))> control;
    iovec part;
  };
  std::vector<std::uint8_t> memory(kDatagramsAtOnce * kDatagramBytes);
  std::array<Slot, kDatagramsAtOnce> slots{};
  std::array<mmsghdr, kDatagramsAtOnce> messages{};
  for (;;) {
    std::array<pollfd, 2> polled = {{{socket_.get(), POLLIN, 0}, {stop_.get(), POLLIN, 0}}};
    if (::poll(polled.data(), polled.size(), -1) < 0 && errno != EINTR) return;
    if (polled[1].revents != 0) return;
    for (std::size_t i = 0; i < kDatagramsAtOnce; ++i) {
      slots[i].part = {memory.data() + i * kDatagramBytes, kDatagramBytes};
      messages[i] = {};
      messages[i].msg_hdr.msg_iov = &slots[i].part;
      messages[i].msg_hdr.msg_iovlen = 1;
      messages[i].msg_hdr.msg_control = slots[i].control.data();
      messages[i].msg_hdr.msg_controllen = slots[i].control.size();
    }
    const int count = ::recvmmsg(socket_.get(), messages.data(), kDatagramsAtOnce, 0, nullptr);
    if (count <= 0) continue;
    {
      const std::lock_guard lock(mutex_);
      for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
        take({memory.data() + i * kDatagramBytes, messages[i].msg_len});
        msghdr& header = messages[i].msg_hdr;
        for (cmsghdr* control = CMSG_FIRSTHDR(&header); control != nullptr; control = CMSG_NXTHDR(&header, control)) {
          if (control->cmsg_level != SOL_SOCKET || control->cmsg_type != SO_RXQ_OVFL) continue;
          std::uint32_t dropped = 0;  // since the socket was made
          std::memcpy(&dropped, CMSG_DATA(control), sizeof dropped);
          counters_.socket_full = dropped;
        }
      }
    }
    arrived_.notify_one();
  }
}

/// Called with the lock held.
void UdpGroupReceiver::take(std::span<const std::uint8_t> datagram) {
  const LcmDatagram parsed = parse_lcm_datagram(datagram);
  if (parsed.fragment) {
    ++counters_.fragments;
  } else if (parsed.channel.empty()) {
    ++counters_.foreign;
  } else if (!wanted_.contains(parsed.channel)) {
    return;
  } else if (queue_.size() >= kMostQueuedLetters || queued_bytes_ + parsed.bytes.size() > kMostQueuedBytes) {
    ++counters_.queue_full;
  } else {
    ++counters_.accepted;
    queued_bytes_ += parsed.bytes.size();
    queue_.push_back({std::string(parsed.channel), {parsed.bytes.begin(), parsed.bytes.end()}});
  }
}

bool UdpGroupReceiver::handle(std::chrono::milliseconds timeout) {
  for (std::size_t handed = 0; handed < kLettersAtOnce; ++handed) {
    Letter letter;
    {
      std::unique_lock lock(mutex_);
      const auto patience = handed == 0 ? timeout : std::chrono::milliseconds(0);
      if (!arrived_.wait_for(lock, patience, [this] { return !queue_.empty(); })) return handed > 0;
      letter = std::move(queue_.front());
      queue_.pop_front();
      queued_bytes_ -= letter.bytes.size();
    }
    const auto [first, last] = handlers_.equal_range(letter.channel);
    for (auto handler = first; handler != last; ++handler) handler->second(letter.bytes);
  }
  return true;
}

UdpGroupReceiver::Counters UdpGroupReceiver::counters() const {
  const std::lock_guard lock(mutex_);
  return counters_;
}

}  // namespace vantage
