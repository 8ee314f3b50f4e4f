#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include <netinet/in.h>

#include "calib/files/file_descriptor.h"
#include "lcmtypes/link/message_bus.h"

namespace vantage {

/// Hears LCM messages of one datagram on a UDP multicast group, whatever else is sent there.
///
/// liblcm 1.3.1 must not be let near an open network: a datagram without the zero behind its channel, or a fragment
/// with impossible numbers, ends the program (docs/decisions/0008). Here each length is checked before it is used,
/// fragments are not put together (no message of ours has any), and what nobody has subscribed to is dropped at once.
///
/// A thread of its own empties the socket into a queue of bounded size; when it is full, the newest is dropped.
class UdpGroupReceiver {
 public:
  struct Counters {
    std::uint64_t accepted = 0;
    std::uint64_t foreign = 0;      ///< no LCM message, or a malformed one
    std::uint64_t fragments = 0;    ///< of LCM messages above 64 KiB
    std::uint64_t queue_full = 0;   ///< dropped here: `handle` was not called in time
    std::uint64_t socket_full = 0;  ///< dropped by the kernel
  };

  /// Begins to listen. Only what is sent to the group is heard, not what is sent to this machine's own address.
  /// \throws InputError when the socket can't be had.
  UdpGroupReceiver(in_addr group, std::uint16_t port, int socket_buffer_bytes);
  ~UdpGroupReceiver();
  UdpGroupReceiver(const UdpGroupReceiver&) = delete;
  UdpGroupReceiver& operator=(const UdpGroupReceiver&) = delete;

  void subscribe(std::string_view channel, MessageBus::Handler handler);
  /// Hands over what has come, a few dozen messages at most, in this thread; waits up to `timeout` for the first. What
  /// a handler throws passes through. False when nothing came.
  bool handle(std::chrono::milliseconds timeout);

  Counters counters() const;

 private:
  struct Letter {
    std::string channel;
    std::vector<std::uint8_t> bytes;
  };

  void listen();
  void take(std::span<const std::uint8_t> datagram);

  FileDescriptor socket_, stop_;
  std::multimap<std::string, MessageBus::Handler, std::less<>>
      handlers_;  // only the thread that subscribes and handles

  mutable std::mutex mutex_;  // guards what follows, but the thread
  std::condition_variable arrived_;
  std::map<std::string, int, std::less<>> wanted_;  // the channels of handlers_
  std::deque<Letter> queue_;
  std::size_t queued_bytes_ = 0;
  Counters counters_;

  std::thread thread_;
};

/// The channel and the message of an LCM datagram (magic LC02): nothing but what lies within `datagram`, or empty views
/// when it is malformed. `fragment` is set when it is one of LCM's fragments (LC03), which are not looked into.
struct LcmDatagram {
  std::string_view channel;
  std::span<const std::uint8_t> bytes;
  bool fragment = false;
};
LcmDatagram parse_lcm_datagram(std::span<const std::uint8_t> datagram);

}  // namespace vantage
