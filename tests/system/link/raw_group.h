#pragma once

#include <cstdint>
#include <vector>

#include <netinet/in.h>

namespace vantage {

/// LCM's default multicast group without LCM: whole datagrams as they are on the wire.
class RawGroup {
 public:
  RawGroup();
  ~RawGroup();
  RawGroup(const RawGroup&) = delete;
  RawGroup& operator=(const RawGroup&) = delete;

  /// Waits 20 ms at most.
  bool receive(std::vector<std::uint8_t>* datagram);
  void send(const std::vector<std::uint8_t>& datagram);
  /// From now on nothing piles up here.
  void stop_hearing();

  /// Datagrams that this network's sockets on the group's port have lost for want of room, all together.
  static std::int64_t drops();

 private:
  int in_, out_;
  sockaddr_in group_{};
};

}  // namespace vantage
