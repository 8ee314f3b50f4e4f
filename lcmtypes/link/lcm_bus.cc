#include "lcmtypes/link/lcm_bus.h"

#include <cerrno>
#include <cstring>
#include <exception>
#include <list>
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

/// LCM itself prints many lines and gives up without a reason when no route leads to its group.
void require_multicast_route(const std::string& url) {
  constexpr std::string_view kScheme = "udpm://";
  if (!url.starts_with(kScheme)) return;
  const std::size_t end = url.find_first_of(":?", kScheme.size());
  const std::string group = url.substr(kScheme.size(), end == std::string::npos ? end : end - kScheme.size());
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
  require_multicast_route(url);
  impl_->lcm = ::lcm_create(url.c_str());
  if (impl_->lcm == nullptr) throw InputError(url + ": LCM can't use this address");
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
