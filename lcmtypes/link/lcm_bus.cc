#include "lcmtypes/link/lcm_bus.h"

#include <cerrno>
#include <charconv>
#include <cstring>
#include <exception>
#include <fstream>
#include <list>
#include <sstream>
#include <stdexcept>
#include <utility>

#include <arpa/inet.h>
#include <lcm/lcm.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include "calib/files/input_error.h"

namespace vantage {
namespace {

constexpr std::string_view kUdp = "udpm://";

/// The multicast group of a udpm:// address. \throws InputError when it has none, or no route leads there: LCM itself
/// prints many lines then and gives up without a reason.
in_addr reachable_group(const std::string& url) {
  const std::size_t end = url.find_first_of(":?", kUdp.size());
  const std::string group = url.substr(kUdp.size(), end == std::string::npos ? end : end - kUdp.size());
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(1);
  if (::inet_pton(AF_INET, group.c_str(), &address.sin_addr) != 1) {
    throw InputError(url + ": \"" + group + "\" is no IPv4 address; give e.g. " + LcmBus::kDefaultUrl);
  }
  const int probe = ::socket(AF_INET, SOCK_DGRAM, 0);
  // Connecting a datagram socket sends nothing; it only looks up the route.
  const int status = ::connect(probe, reinterpret_cast<const sockaddr*>(&address), sizeof address);
  const int error = errno;
  ::close(probe);
  if (status != 0) {
    throw InputError("LCM has no route to its multicast group " + group + " (" + std::strerror(error) +
                     "): run  ip route add 224.0.0.0/4 dev lo  as root, or start through scripts/private-network");
  }
  return address.sin_addr;
}

/// The interface of the most special route to an address, by the kernel's table; empty when it has none.
std::string interface_to(in_addr address) {
  std::ifstream table("/proc/net/route");
  std::string line, found;
  std::uint32_t longest_mask = 0;
  std::getline(table, line);  // the columns' names
  while (std::getline(table, line)) {
    std::istringstream columns(line);
    std::string name, gateway, flags, references, use, metric;
    std::uint32_t destination = 0, mask = 0;  // in network order, as in_addr
    columns >> name >> std::hex >> destination >> gateway >> flags >> references >> use >> metric >> mask;
    if (!columns || (address.s_addr & mask) != destination) continue;
    if (!found.empty() && ntohl(mask) <= longest_mask) continue;
    found = name;
    longest_mask = ntohl(mask);
  }
  return found;
}

constexpr std::uint16_t kDefaultPort = 7667;
constexpr int kDefaultSocketBuffer = 4 << 20;
constexpr std::size_t kMostMessageBytes = 65'000;

/// The value of `key=` in an address; empty when it has none.
std::string parameter(const std::string& url, const std::string& key) {
  for (std::size_t at = url.find('?'); at != std::string::npos; at = url.find('&', at + 1)) {
    if (url.compare(at + 1, key.size() + 1, key + "=") != 0) continue;
    const std::size_t begin = at + key.size() + 2;
    return url.substr(begin, url.find('&', begin) - begin);
  }
  return "";
}

std::uint16_t port_of(const std::string& url) {
  const std::size_t colon = url.find(':', kUdp.size());
  if (colon == std::string::npos || colon > url.find('?')) return kDefaultPort;
  unsigned port = 0;
  const auto [end, error] = std::from_chars(url.data() + colon + 1, url.data() + url.size(), port);
  const bool ends = end == url.data() + url.size() || *end == '?';
  if (error != std::errc() || !ends || port == 0 || port > UINT16_MAX) {
    throw InputError(url + ": has no port between 1 and 65535; give e.g. " + LcmBus::kDefaultUrl);
  }
  return static_cast<std::uint16_t>(port);
}

int socket_buffer(const std::string& url) {
  const std::string text = parameter(url, "recv_buf_size");
  int bytes = kDefaultSocketBuffer;
  if (!text.empty()) std::from_chars(text.data(), text.data() + text.size(), bytes);
  return bytes;
}

}  // namespace

struct LcmBus::Impl {
  struct Subscription {
    Impl* owner;
    Handler handler;
  };

  lcm_t* lcm = nullptr;                        // speaks; hears where it is not UDP
  std::unique_ptr<UdpGroupReceiver> receiver;  // hears UDP
  std::list<Subscription> subscriptions;       // LCM keeps pointers to them
  std::exception_ptr thrown;                   // by a handler: it must not pass LCM's C frames

  static void deliver(const lcm_recv_buf_t* received, const char*, void* user) {
    auto* subscription = static_cast<Subscription*>(user);
    try {
      subscription->handler({static_cast<const std::uint8_t*>(received->data), received->data_size});
    } catch (...) {
      subscription->owner->thrown = std::current_exception();
    }
  }
};

LcmBus::LcmBus(const std::string& url) : impl_(std::make_unique<Impl>()) {
  if (url.starts_with(kUdp)) {
    impl_->receiver = std::make_unique<UdpGroupReceiver>(reachable_group(url), port_of(url), socket_buffer(url));
  }
  impl_->lcm = ::lcm_create(url.c_str());
  if (impl_->lcm == nullptr) throw InputError(url + ": LCM can't use this address");
}

bool LcmBus::stays_on_this_machine(const std::string& url) {
  if (url.starts_with("memq://") || url.starts_with("file://")) return true;
  if (!url.starts_with(kUdp)) return false;
  const std::string time_to_live = parameter(url, "ttl");  // LCM's own default is 0
  return (time_to_live.empty() || time_to_live == "0") && interface_to(reachable_group(url)) == "lo";
}

LcmBus::~LcmBus() { ::lcm_destroy(impl_->lcm); }

void LcmBus::publish(std::string_view channel, std::span<const std::uint8_t> bytes) {
  if (impl_->receiver && bytes.size() > kMostMessageBytes) {
    throw std::length_error("LcmBus: a message of " + std::to_string(bytes.size()) + " bytes is more than a datagram");
  }
  // The status says nothing of arrival; whoever needs certainty asks for a receipt.
  ::lcm_publish(impl_->lcm, std::string(channel).c_str(), bytes.data(), static_cast<unsigned>(bytes.size()));
}

void LcmBus::subscribe(std::string_view channel, Handler handler) {
  if (impl_->receiver) return impl_->receiver->subscribe(channel, std::move(handler));
  Impl::Subscription& kept = impl_->subscriptions.emplace_back(Impl::Subscription{impl_.get(), std::move(handler)});
  ::lcm_subscribe(impl_->lcm, std::string(channel).c_str(), &Impl::deliver, &kept);
}

bool LcmBus::handle(std::chrono::milliseconds timeout) {
  if (impl_->receiver) return impl_->receiver->handle(timeout);
  const int status = ::lcm_handle_timeout(impl_->lcm, static_cast<int>(timeout.count()));
  if (impl_->thrown) std::rethrow_exception(std::exchange(impl_->thrown, nullptr));
  return status > 0;
}

UdpGroupReceiver::Counters LcmBus::counters() const {
  return impl_->receiver ? impl_->receiver->counters() : UdpGroupReceiver::Counters{};
}

}  // namespace vantage
