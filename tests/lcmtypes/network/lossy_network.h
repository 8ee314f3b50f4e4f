#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include <sys/types.h>

namespace vantage {

/// What happens to each datagram on its way, in both directions.
struct Impairment {
  double loss = 0;       ///< share that vanishes
  double duplicate = 0;  ///< share that comes twice
  double reorder = 0;    ///< share that is overtaken: it takes up to `detour` longer
  std::chrono::microseconds delay{200};
  std::chrono::microseconds detour{8000};
  std::uint64_t seed = 1;
};

/// Who impairs the network.
enum class Impairer {
  kForwarder,  ///< this program, between two pairs of virtual interfaces
  kNetem       ///< the kernel's tc netem, on one pair
};

/// Two computers' networks, joined by a bad one: each side has a network namespace of its own, with a virtual Ethernet
/// interface and LCM's multicast route over it. Nothing leaves this machine.
///
/// The process that makes it must have one thread and be root of its own network namespace (scripts/private-network).
class LossyNetwork {
 public:
  enum Side { kRobot = 0, kPlanner = 1 };
  static constexpr const char* kUrl = "udpm://239.255.76.67:7667?ttl=1&recv_buf_size=4194304";

  /// \throws std::runtime_error naming the command that failed, e.g. where the kernel has no netem.
  LossyNetwork(const Impairment& impairment, Impairer impairer);
  /// Ends the programs that still run.
  ~LossyNetwork();
  LossyNetwork(const LossyNetwork&) = delete;
  LossyNetwork& operator=(const LossyNetwork&) = delete;

  /// Runs a program on that side, in a process of its own that ends with what it returns. Once a side.
  void start(Side side, const std::function<int()>& program);

  /// Forwards until every program has ended. True when all ended with 0.
  bool run();

  std::uint64_t forwarded() const { return forwarded_; }
  std::uint64_t lost() const { return lost_; }

 private:
  struct Child {
    pid_t pid = -1;
    int go = -1;  // a byte here lets its program begin
  };

  void connect_side(Side side);
  void forward();
  bool all_ended();

  Impairment impairment_;
  Impairer impairer_;
  std::array<Child, 2> children_;
  bool all_well_ = true;
  std::uint64_t forwarded_ = 0, lost_ = 0;
};

}  // namespace vantage
