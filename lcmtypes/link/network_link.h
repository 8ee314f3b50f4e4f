#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "lcmtypes/link/lcm_bus.h"
#include "lcmtypes/link/sealed_bus.h"
#include "lcmtypes/link/status.h"

namespace vantage {

/// How a program joins the network.
struct NetworkOptions {
  std::string url = LcmBus::kDefaultUrl;
  std::vector<std::filesystem::path> keys = {};  ///< files of vantage-keygen; the first seals, any opens
  bool insecure = false;                         ///< without keys beyond this machine too
};

/// The network as a program uses it: LCM, sealed where there is a key.
class NetworkLink {
 public:
  /// \throws InputError with the mend: a key that can't be used; no key although others could reach the address; what
  /// LcmBus throws.
  explicit NetworkLink(const NetworkOptions& options);

  MessageBus& bus() { return sealed_ ? static_cast<MessageBus&>(*sealed_) : lcm_; }
  /// For the program's status: what was refused at the seal.
  Status::Counters counters() const;

 private:
  LcmBus lcm_;
  std::unique_ptr<SealedBus> sealed_;
};

}  // namespace vantage
