#include "lcmtypes/link/network_link.h"

#include "calib/files/input_error.h"

namespace vantage {

NetworkLink::NetworkLink(const NetworkOptions& options) : lcm_(options.url) {
  std::vector<LinkKey> keys;
  for (const std::filesystem::path& path : options.keys) keys.push_back(read_link_key(path));
  if (!keys.empty()) {
    sealed_ = std::make_unique<SealedBus>(lcm_, std::move(keys));
  } else if (!options.insecure && !LcmBus::stays_on_this_machine(options.url)) {
    throw InputError(
        options.url +
        ": others can reach this address, and no key is given: make one with  vantage-keygen FILE  and give "
        "--key FILE to every program, or --insecure on a network where you trust everyone");
  }
}

std::optional<std::uint64_t> NetworkLink::seals_to_tell() {
  if (!sealed_ || sealed_->refused() == told_ || !words_.due()) return std::nullopt;
  return told_ = sealed_->refused();
}

Status::Counters NetworkLink::counters() const {
  const UdpGroupReceiver::Counters datagrams = lcm_.counters();
  return {{"datagrams.accepted", datagrams.accepted},       {"datagrams.foreign", datagrams.foreign},
          {"datagrams.fragments", datagrams.fragments},     {"datagrams.queue_full", datagrams.queue_full},
          {"datagrams.socket_full", datagrams.socket_full}, {"seals.refused", sealed_ ? sealed_->refused() : 0}};
}

}  // namespace vantage
