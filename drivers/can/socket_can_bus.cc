#include "drivers/can/socket_can_bus.h"

#include <array>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <vector>

#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/netlink.h>
#include <linux/can/raw.h>
#include <linux/if_link.h>
#include <linux/rtnetlink.h>
#include <net/if.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/socket.h>

#include "calib/files/file_descriptor.h"
#include "calib/files/input_error.h"

namespace vantage::can {
namespace {

using std::chrono::nanoseconds;

constexpr std::uint32_t kErrorMask = CAN_ERR_TX_TIMEOUT | CAN_ERR_CRTL | CAN_ERR_PROT | CAN_ERR_ACK | CAN_ERR_BUSOFF |
                                     CAN_ERR_BUSERROR | CAN_ERR_RESTARTED;
constexpr std::size_t kBatch = 32;  // frames taken from the kernel by one call
constexpr nanoseconds kOldestStamp = std::chrono::seconds(1);

nanoseconds now_of(clockid_t clock) {
  timespec time{};
  ::clock_gettime(clock, &time);
  return std::chrono::seconds(time.tv_sec) + nanoseconds(time.tv_nsec);
}

timespec timespec_of(nanoseconds time) {
  const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(time);
  return {static_cast<time_t>(seconds.count()), static_cast<long>((time - seconds).count())};
}

/// A netlink message that asks for IFLA_CAN_RESTART; the attributes nest three deep.
class RestartRequest {
 public:
  explicit RestartRequest(int interface_index) {
    header_.nlmsg_type = RTM_NEWLINK;
    header_.nlmsg_flags = NLM_F_REQUEST | NLM_F_ACK;
    ifinfomsg info{};
    info.ifi_family = AF_UNSPEC;
    info.ifi_index = interface_index;
    append(&header_, sizeof header_);
    append(&info, sizeof info);
    const std::size_t link_info = open(IFLA_LINKINFO);
    const std::size_t kind = open(IFLA_INFO_KIND);
    append("can", 3);
    close(kind);
    const std::size_t data = open(IFLA_INFO_DATA);
    const std::size_t restart = open(IFLA_CAN_RESTART);
    const std::uint32_t yes = 1;
    append(&yes, sizeof yes);
    close(restart);
    close(data);
    close(link_info);
    header_.nlmsg_len = static_cast<std::uint32_t>(bytes_.size());
    std::memcpy(bytes_.data(), &header_, sizeof header_);
  }

  const std::vector<char>& bytes() const { return bytes_; }

 private:
  void append(const void* from, std::size_t size) {
    const auto* first = static_cast<const char*>(from);
    bytes_.insert(bytes_.end(), first, first + size);
    bytes_.resize(NLMSG_ALIGN(bytes_.size()));
    end_ = bytes_.size() - (NLMSG_ALIGN(size) - size);
  }
  std::size_t open(unsigned short type) {
    const std::size_t at = bytes_.size();
    const rtattr attribute{0, type};
    append(&attribute, sizeof attribute);
    return at;
  }
  void close(std::size_t at) {
    const auto length = static_cast<unsigned short>(end_ - at);
    std::memcpy(bytes_.data() + at, &length, sizeof length);
  }

  nlmsghdr header_{};
  std::vector<char> bytes_;
  std::size_t end_ = 0;  // of what was appended last, without its padding
};

/// 0, or the errno that the kernel answers.
int ask_kernel(const std::vector<char>& request) {
  const FileDescriptor socket(::socket(AF_NETLINK, SOCK_RAW | SOCK_CLOEXEC, NETLINK_ROUTE));
  if (!socket.valid()) return errno;
  if (::send(socket.get(), request.data(), request.size(), 0) < 0) return errno;
  alignas(nlmsghdr) std::array<char, 8192> answer{};
  const ssize_t size = ::recv(socket.get(), answer.data(), answer.size(), 0);
  if (size < static_cast<ssize_t>(NLMSG_LENGTH(sizeof(nlmsgerr)))) return size < 0 ? errno : EPROTO;
  const auto* header = reinterpret_cast<const nlmsghdr*>(answer.data());
  if (header->nlmsg_type != NLMSG_ERROR) return EPROTO;
  return -static_cast<const nlmsgerr*>(NLMSG_DATA(header))->error;
}

class SocketCanBus final : public CanBus {
 public:
  explicit SocketCanBus(const std::string& interface) : interface_(interface) {
    if (interface.empty() || interface.size() >= IFNAMSIZ) {
      throw InputError("--can " + interface + ": an interface's name has 1 to " + std::to_string(IFNAMSIZ - 1) +
                       " characters");
    }
    socket_ = FileDescriptor(::socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC | SOCK_NONBLOCK, CAN_RAW));
    if (!socket_.valid()) {
      throw InputError(interface + ": this kernel has no SocketCAN (" + std::strerror(errno) +
                       "); load it with  modprobe can-raw");
    }
    const unsigned index = ::if_nametoindex(interface.c_str());
    if (index == 0) {
      throw InputError(interface + ": no such network interface; bring it up with  ip link set " + interface +
                       " up type can bitrate 1000000");
    }
    index_ = static_cast<int>(index);
    accept_only({});
    set_option(SOL_CAN_RAW, CAN_RAW_ERR_FILTER, kErrorMask);
    set_option(SOL_SOCKET, SO_TIMESTAMPNS, 1);
    set_option(SOL_SOCKET, SO_RXQ_OVFL, 1);
    sockaddr_can address{};
    address.can_family = AF_CAN;
    address.can_ifindex = index_;
    if (::bind(socket_.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
      throw InputError(interface + ": is no CAN interface (" + std::strerror(errno) + ")");
    }
    for (std::size_t i = 0; i < kBatch; ++i) {
      parts_[i] = {&frames_[i], sizeof frames_[i]};
      messages_[i].msg_hdr.msg_iov = &parts_[i];
      messages_[i].msg_hdr.msg_iovlen = 1;
      messages_[i].msg_hdr.msg_control = controls_[i].bytes;
    }
  }

  SendResult send(const CanFrame& frame) override {
    const WireFrame wire = write_wire(frame);
    ssize_t written = -1;
    do {
      written = ::send(socket_.get(), wire.data(), wire.size(), MSG_NOSIGNAL);
    } while (written < 0 && errno == EINTR);
    if (written == static_cast<ssize_t>(wire.size())) {
      ++counters_.sent;
      return SendResult::kSent;
    }
    ++counters_.refused_sends;
    if (errno == ENETDOWN) return SendResult::kDown;
    return errno == ENXIO || errno == ENODEV ? SendResult::kGone : SendResult::kQueueFull;
  }

  ReceiveResult receive(CanFrame* frame) override {
    while (true) {
      if (next_ == taken_) {
        const ReceiveResult result = take_batch();
        if (result != ReceiveResult::kFrame) return result;
      }
      const std::size_t i = next_++;
      if (!read_wire(std::as_bytes(std::span(&frames_[i], 1)).first(messages_[i].msg_len), frame)) {
        ++counters_.malformed;
        continue;
      }
      read_control(messages_[i].msg_hdr, frame);
      ++counters_.received;
      return ReceiveResult::kFrame;
    }
  }

  bool wait_until(nanoseconds deadline) override {
    while (next_ == taken_) {
      const nanoseconds left = deadline - now_of(CLOCK_MONOTONIC);
      const timespec timeout = timespec_of(std::max(left, nanoseconds(0)));
      pollfd polled{socket_.get(), POLLIN, 0};
      const int ready = ::ppoll(&polled, 1, &timeout, nullptr);
      if (ready > 0) return true;
      if (ready == 0 || errno != EINTR) return false;
    }
    return true;
  }

  void sleep_until(nanoseconds deadline) override {
    const timespec time = timespec_of(deadline);
    while (::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &time, nullptr) == EINTR) {
    }
  }

  void accept_only(std::span<const std::uint32_t> ids) override {
    std::vector<can_filter> filters;
    for (const std::uint32_t id : ids) filters.push_back({id, CAN_SFF_MASK | CAN_EFF_FLAG | CAN_RTR_FLAG});
    ::setsockopt(socket_.get(), SOL_CAN_RAW, CAN_RAW_FILTER, filters.empty() ? nullptr : filters.data(),
                 static_cast<socklen_t>(filters.size() * sizeof(can_filter)));
  }

  bool restart(std::string* why) override {
    const int error = ask_kernel(RestartRequest(index_).bytes());
    if (error == 0) return true;
    switch (error) {
      case EPERM:
        *why = interface_ + ": restarting the controller needs CAP_NET_ADMIN, or  ip link set " + interface_ +
               " type can restart-ms 100";
        break;
      case EBUSY:
        *why = interface_ + ": the controller is not in bus-off";
        break;
      case EINVAL:
        *why = interface_ + ": restarts by itself (restart-ms is not 0), or is set down";
        break;
      default:
        *why = interface_ + ": the controller can't be restarted: " + std::strerror(error);
    }
    return false;
  }

  const BusCounters& counters() const override { return counters_; }
  std::string name() const override { return interface_; }

 private:
  union Control {
    cmsghdr header;
    char bytes[CMSG_SPACE(sizeof(timespec)) + CMSG_SPACE(sizeof(std::uint32_t))];
  };

  void set_option(int level, int option, std::uint32_t value) {
    if (::setsockopt(socket_.get(), level, option, &value, sizeof value) != 0) {
      throw InputError(interface_ + ": a socket option is refused: " + std::strerror(errno));
    }
  }

  ReceiveResult take_batch() {
    for (mmsghdr& message : messages_) message.msg_hdr.msg_controllen = sizeof(Control);
    int count = -1;
    do {
      count = ::recvmmsg(socket_.get(), messages_.data(), kBatch, MSG_DONTWAIT, nullptr);
    } while (count < 0 && errno == EINTR);
    next_ = 0;
    taken_ = count > 0 ? static_cast<std::size_t>(count) : 0;
    if (count > 0) {
      // The stamps are of the real-time clock; frames of one batch share one reading of both clocks.
      monotonic_ = now_of(CLOCK_MONOTONIC);
      realtime_ = now_of(CLOCK_REALTIME);
      return ReceiveResult::kFrame;
    }
    if (errno == ENETDOWN) return ReceiveResult::kDown;
    return errno == ENODEV || errno == ENXIO ? ReceiveResult::kGone : ReceiveResult::kNothing;
  }

  void read_control(const msghdr& message, CanFrame* frame) {
    frame->time = monotonic_;
    auto* at = const_cast<msghdr*>(&message);
    for (cmsghdr* header = CMSG_FIRSTHDR(at); header != nullptr; header = CMSG_NXTHDR(at, header)) {
      if (header->cmsg_level != SOL_SOCKET) continue;
      if (header->cmsg_type == SO_TIMESTAMPNS) {
        timespec stamp{};
        std::memcpy(&stamp, CMSG_DATA(header), sizeof stamp);
        const nanoseconds age = realtime_ - std::chrono::seconds(stamp.tv_sec) - nanoseconds(stamp.tv_nsec);
        if (age >= nanoseconds(0) && age <= kOldestStamp) {
          frame->time = monotonic_ - age;
        } else {
          ++counters_.odd_stamps;
        }
      } else if (header->cmsg_type == SO_RXQ_OVFL) {
        std::uint32_t dropped = 0;  // since the socket was opened
        std::memcpy(&dropped, CMSG_DATA(header), sizeof dropped);
        counters_.overflowed = dropped;
      }
    }
  }

  std::string interface_;
  FileDescriptor socket_;
  int index_ = 0;
  std::array<can_frame, kBatch> frames_{};
  std::array<iovec, kBatch> parts_{};
  std::array<Control, kBatch> controls_{};
  std::array<mmsghdr, kBatch> messages_{};
  std::size_t next_ = 0, taken_ = 0;  // of the batch
  nanoseconds monotonic_{0}, realtime_{0};
  BusCounters counters_;
};

}  // namespace

std::unique_ptr<CanBus> open_socket_can(const std::string& interface) {
  return std::make_unique<SocketCanBus>(interface);
}

}  // namespace vantage::can
