#include "lcmtypes/link/lcm_bus.h"

#include <cerrno>
#include <cstring>
#include <exception>
#include <fstream>
#include <list>
#include <sstream>
#include <utility>

#include <arpa/inet.h>
#include <lcm/lcm.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include "calib/files/input_error.h"

namespace vantage {
namespace {

/// Messages kept for one channel before LCM drops the newest: a depth map's chunks come in bursts of some hundred.
constexpr int kQueueCapacity = 4096;

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

/// The `ttl` of an address; LCM's own default is 0.
std::string time_to_live(const std::string& url) {
  const std::size_t key = url.find("ttl=");
  if (key == std::string::npos) return "0";
  return url.substr(key + 4, url.find('&', key) - key - 4);
}

}  // namespace

struct LcmBus::Impl {
  struct Subscription {
    Impl* owner;
    Handler handler;
  };

  lcm_t* lcm = nullptr;
  std::list<Subscription> subscriptions;  // LCM keeps pointers to them
  std::exception_ptr thrown;              // by a handler: it must not pass LCM's C frames

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
  if (url.starts_with(kUdp)) reachable_group(url);  // throws where there is no route
  impl_->lcm = ::lcm_create(url.c_str());
  if (impl_->lcm == nullptr) throw InputError(url + ": LCM can't use this address");
}

bool LcmBus::stays_on_this_machine(const std::string& url) {
  if (url.starts_with("memq://") || url.starts_with("file://")) return true;
  return url.starts_with(kUdp) && time_to_live(url) == "0" && interface_to(reachable_group(url)) == "lo";
}

LcmBus::~LcmBus() { ::lcm_destroy(impl_->lcm); }

void LcmBus::publish(std::string_view channel, std::span<const std::uint8_t> bytes) {
  // The status says nothing of arrival; whoever needs certainty asks for a receipt.
  ::lcm_publish(impl_->lcm, std::string(channel).c_str(), bytes.data(), static_cast<unsigned>(bytes.size()));
}

void LcmBus::subscribe(std::string_view channel, Handler handler) {
  Impl::Subscription& kept = impl_->subscriptions.emplace_back(Impl::Subscription{impl_.get(), std::move(handler)});
  lcm_subscription_t* subscription = ::lcm_subscribe(impl_->lcm, std::string(channel).c_str(), &Impl::deliver, &kept);
  ::lcm_subscription_set_queue_capacity(subscription, kQueueCapacity);
}

bool LcmBus::handle(std::chrono::milliseconds timeout) {
  const int status = ::lcm_handle_timeout(impl_->lcm, static_cast<int>(timeout.count()));
  if (impl_->thrown) std::rethrow_exception(std::exchange(impl_->thrown, nullptr));
  return status > 0;
}

}  // namespace vantage
