#pragma once

#include <memory>
#include <string>

#include "lcmtypes/link/message_bus.h"
#include "lcmtypes/link/udp_group_receiver.h"

namespace vantage {

/// The bus between computers: LCM over UDP multicast. Programs of liblcm hear it and are heard; messages have at most
/// 65,000 bytes, so that each is one datagram.
class LcmBus final : public MessageBus {
 public:
  /// Stays on this machine (TTL 0) with a receive buffer of 4 MiB, where the kernel grants it.
  static constexpr const char* kDefaultUrl = "udpm://239.255.76.67:7667?ttl=0&recv_buf_size=4194304";

  /// True when what is said there can neither leave this machine nor come from another: TTL 0 and a multicast route
  /// over loopback, or no network at all (memq://, file://).
  static bool stays_on_this_machine(const std::string& url);

  /// `url`: as LCM's LCM_DEFAULT_URL. \throws InputError with the mend when the machine has no multicast route, or LCM
  /// does not take the address.
  explicit LcmBus(const std::string& url = kDefaultUrl);
  ~LcmBus() override;

  void publish(std::string_view channel, std::span<const std::uint8_t> bytes) override;
  void subscribe(std::string_view channel, Handler handler) override;
  bool handle(std::chrono::milliseconds timeout) override;

  /// What came over UDP, and what of it went no further.
  UdpGroupReceiver::Counters counters() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace vantage
