#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "lcmtypes/link/clock.h"
#include "lcmtypes/link/lcm_bus.h"
#include "lcmtypes/link/rare_log.h"
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
  /// For the program's status: what came, and what was refused before it was decoded.
  Status::Counters counters() const;
  /// How many messages had no right seal so far, when that has grown since it was told, once a second at most: for the
  /// log.
  std::optional<std::uint64_t> seals_to_tell();

 private:
  LcmBus lcm_;
  std::unique_ptr<SealedBus> sealed_;
  SystemClock clock_;
  RareLog words_{clock_};
  std::uint64_t told_ = 0;
};

}  // namespace vantage
