#include "drivers/can/unix_can_bus.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <vector>

#include <fcntl.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include "calib/files/input_error.h"
#include "drivers/sim/unix_socket.h"

namespace vantage::can {
namespace {

using sim::ReceiveStatus;
using std::chrono::nanoseconds;

constexpr std::size_t kMostNodes = 16;

nanoseconds monotonic_now() {
  timespec time{};
  ::clock_gettime(CLOCK_MONOTONIC, &time);
  return std::chrono::seconds(time.tv_sec) + nanoseconds(time.tv_nsec);
}

/// What server and member have in common: time, filters and counters.
class UnixCanBus : public CanBus {
 public:
  explicit UnixCanBus(std::filesystem::path path) : path_(std::move(path)) { accepted_.fill(true); }

  void sleep_until(nanoseconds deadline) override {
    const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(deadline);
    const timespec time{static_cast<time_t>(seconds.count()), static_cast<long>((deadline - seconds).count())};
    while (::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &time, nullptr) == EINTR) {
    }
  }
  void accept_only(std::span<const std::uint32_t> ids) override {
    accepted_.fill(false);
    for (const std::uint32_t id : ids) accepted_[id % accepted_.size()] = true;
  }
  bool restart(std::string* why) override {
    *why = name() + ": a simulated bus has no controller to restart";
    return false;
  }
  const BusCounters& counters() const override { return counters_; }
  std::string name() const override { return "sim:" + path_.string(); }

 protected:
  static bool poll_until(std::vector<pollfd>* polled, nanoseconds deadline) {
    const nanoseconds left = std::max(deadline - monotonic_now(), nanoseconds(0));
    const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(left);
    const timespec timeout{static_cast<time_t>(seconds.count()), static_cast<long>((left - seconds).count())};
    return ::ppoll(polled->data(), polled->size(), &timeout, nullptr) > 0;
  }

  /// Reads a datagram into `frame`. False when it is none, or of an identifier that is not wanted here.
  bool accept(std::span<const std::byte> datagram, CanFrame* frame, bool* malformed) {
    *malformed = !read_wire(datagram, frame);
    if (*malformed) {
      ++counters_.malformed;
      return false;
    }
    frame->time = monotonic_now();
    return frame->error || (frame->id < accepted_.size() && accepted_[frame->id]);
  }

  std::filesystem::path path_;
  std::array<bool, 0x800> accepted_{};
  BusCounters counters_;
};

class Member final : public UnixCanBus {
 public:
  explicit Member(const std::filesystem::path& path) : UnixCanBus(path), socket_(sim::connect_to(path)) {
    if (!socket_.valid()) {
      throw InputError(path.string() + ": nobody serves a simulated CAN bus there (" + std::strerror(errno) +
                       "); start one with  vantage-sim --can sim:" + path.string());
    }
    polled_.push_back({socket_.get(), POLLIN, 0});
  }

  SendResult send(const CanFrame& frame) override {
    const WireFrame wire = write_wire(frame);
    if (sim::send_datagram(socket_.get(), wire)) {
      ++counters_.sent;
      return SendResult::kSent;
    }
    ++counters_.refused_sends;
    return errno == EAGAIN ? SendResult::kQueueFull : SendResult::kGone;
  }

  ReceiveResult receive(CanFrame* frame) override {
    std::array<std::byte, kWireSize + 1> buffer;
    std::size_t size = 0;
    while (true) {
      switch (sim::receive_datagram(socket_.get(), buffer, &size)) {
        case ReceiveStatus::kNothingYet:
          return ReceiveResult::kNothing;
        case ReceiveStatus::kClosed:
          return ReceiveResult::kGone;
        case ReceiveStatus::kDatagram:
          break;
      }
      bool malformed = false;
      if (!accept(std::span(buffer).first(size), frame, &malformed)) continue;
      ++counters_.received;
      return ReceiveResult::kFrame;
    }
  }

  bool wait_until(nanoseconds deadline) override { return poll_until(&polled_, deadline); }

 private:
  FileDescriptor socket_;
  std::vector<pollfd> polled_;
};

class BusServer final : public UnixCanBus {
 public:
  explicit BusServer(const std::filesystem::path& path) : UnixCanBus(path), listener_(sim::listen_at(path)) {
    ::fcntl(listener_.get(), F_SETFL, O_NONBLOCK);
    members_.reserve(kMostNodes);
    polled_.reserve(kMostNodes + 1);
  }
  ~BusServer() override { ::unlink(path_.c_str()); }
  BusServer(const BusServer&) = delete;
  BusServer& operator=(const BusServer&) = delete;

  SendResult send(const CanFrame& frame) override {
    forward(write_wire(frame), members_.size());
    ++counters_.sent;
    return SendResult::kSent;
  }

  ReceiveResult receive(CanFrame* frame) override {
    let_in();
    std::array<std::byte, kWireSize + 1> buffer;
    std::size_t size = 0;
    for (std::size_t i = 0; i < members_.size();) {
      switch (sim::receive_datagram(members_[i].get(), buffer, &size)) {
        case ReceiveStatus::kNothingYet:
          ++i;
          continue;
        case ReceiveStatus::kClosed:
          members_.erase(members_.begin() + static_cast<std::ptrdiff_t>(i));
          continue;
        case ReceiveStatus::kDatagram:
          break;
      }
      bool malformed = false;
      const bool wanted = accept(std::span(buffer).first(size), frame, &malformed);
      if (!malformed) forward(write_wire(*frame), i);
      if (!wanted) continue;
      ++counters_.received;
      return ReceiveResult::kFrame;
    }
    return ReceiveResult::kNothing;
  }

  bool wait_until(nanoseconds deadline) override {
    polled_.clear();
    polled_.push_back({listener_.get(), POLLIN, 0});
    for (const FileDescriptor& member : members_) polled_.push_back({member.get(), POLLIN, 0});
    return poll_until(&polled_, deadline);
  }

 private:
  void let_in() {
    while (members_.size() < kMostNodes) {
      FileDescriptor member(::accept4(listener_.get(), nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK));
      if (!member.valid()) return;
      members_.push_back(std::move(member));
    }
  }

  void forward(const WireFrame& wire, std::size_t from) {
    for (std::size_t i = 0; i < members_.size(); ++i) {
      if (i != from && !sim::send_datagram(members_[i].get(), wire) && errno == EAGAIN) ++counters_.overflowed;
    }
  }

  FileDescriptor listener_;
  std::vector<FileDescriptor> members_;
  std::vector<pollfd> polled_;
};

}  // namespace

std::unique_ptr<CanBus> serve_unix_can(const std::filesystem::path& socket) {
  return std::make_unique<BusServer>(socket);
}

std::unique_ptr<CanBus> join_unix_can(const std::filesystem::path& socket) { return std::make_unique<Member>(socket); }

}  // namespace vantage::can
