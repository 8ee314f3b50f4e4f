#include "drivers/sim/server.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include "calib/files/input_error.h"
#include "drivers/sim/frame_memory.h"
#include "drivers/sim/protocol.h"
#include "drivers/sim/unix_socket.h"
#include "lcmtypes/link/depth_map.h"

namespace vantage::sim {
namespace {

using SteadyClock = std::chrono::steady_clock;

/// A peer that has connected and says nothing makes way after this.
constexpr std::chrono::seconds kGreetingLimit{2};

std::int64_t monotonic_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(SteadyClock::now().time_since_epoch()).count();
}

}  // namespace

class Server::Implementation {
 public:
  Implementation(const StereoCamera& camera, const ServerOptions& options)
      : camera_(camera),
        options_(options),
        memory_(options.slots, camera.pixels()),
        stop_(::eventfd(0, EFD_CLOEXEC)),
        listener_(listen_at(options.socket)),
        pose_(options.first_pose) {
    slot_sequence_.assign(static_cast<std::size_t>(options.slots), 0);
    ::stat(options_.socket.c_str(), &socket_file_);
  }

  /// Removes the socket's file, unless somebody has put another in its place.
  ~Implementation() {
    struct stat now {};
    if (::stat(options_.socket.c_str(), &now) == 0 && now.st_ino == socket_file_.st_ino &&
        now.st_dev == socket_file_.st_dev) {
      ::unlink(options_.socket.c_str());
    }
  }

  ServeEnd run(int stop_fd) {
    waiting_since_ = SteadyClock::now();
    while (!end_) {
      if (capture_wanted_ && free_slot() >= 0) {
        capture();
        continue;
      }
      pollfd polled[] = {
          {stop_.get(), POLLIN, 0}, {stop_fd, POLLIN, 0}, {listener_.get(), POLLIN, 0}, {peer_.get(), POLLIN, 0}};
      if (::poll(polled, 4, static_cast<int>(poll_limit().count())) < 0 && errno != EINTR) {
        throw std::runtime_error("vantage-sim: poll failed");
      }
      if (polled[0].revents != 0 || polled[1].revents != 0) return ServeEnd::kStopped;
      if (polled[3].revents != 0) hear_peer();
      if (polled[2].revents != 0) accept_peer();
      if (peer_.valid() && !greeted_ && SteadyClock::now() - connected_ > kGreetingLimit) peer_.reset();
      if (!greeted_ && options_.wait && SteadyClock::now() - waiting_since_ > *options_.wait)
        return ServeEnd::kNobodyCame;
    }
    return *end_;
  }

  void stop() {
    const std::uint64_t one = 1;
    [[maybe_unused]] const ssize_t written = ::write(stop_.get(), &one, sizeof one);
  }

 private:
  std::chrono::milliseconds poll_limit() const {
    using std::chrono::milliseconds;
    std::optional<SteadyClock::time_point> due;
    if (!greeted_ && options_.wait) due = waiting_since_ + *options_.wait;
    if (!greeted_ && peer_.valid())
      due = std::min(due.value_or(SteadyClock::time_point::max()), connected_ + kGreetingLimit);
    if (!due) return milliseconds(-1);
    const auto left = std::chrono::ceil<milliseconds>(*due - SteadyClock::now()) + milliseconds(1);
    return std::clamp(left, milliseconds(0), milliseconds(60'000));
  }

  void accept_peer() {
    FileDescriptor came(::accept4(listener_.get(), nullptr, nullptr, SOCK_CLOEXEC));
    if (!came.valid()) return;
    if (peer_.valid()) {
      refuse(came.get(), "the simulator serves another client already");
      return;
    }
    peer_ = std::move(came);
    connected_ = SteadyClock::now();
  }

  void hear_peer() {
    std::array<std::byte, kLongestMessage + 1> buffer;
    std::size_t size = 0;
    switch (receive_datagram(peer_.get(), buffer, &size)) {
      case ReceiveStatus::kNothingYet:
        return;
      case ReceiveStatus::kClosed:
        lose_peer();
        return;
      case ReceiveStatus::kDatagram:
        break;
    }
    const std::span<const std::byte> datagram(buffer.data(), size);
    if (greeted_) {
      obey(datagram);
    } else {
      greet(datagram);
    }
  }

  void lose_peer() {
    if (greeted_ && !options_.keep_serving) end_ = ServeEnd::kClientLost;
    peer_.reset();
    if (greeted_) waiting_since_ = SteadyClock::now();
    greeted_ = capture_wanted_ = false;
    std::fill(slot_sequence_.begin(), slot_sequence_.end(), 0);  // nobody holds a frame any more
    pose_id_ = 0;                                                // the next client counts anew
  }

  void greet(std::span<const std::byte> datagram) {
    Hello hello;
    MessageHeader header;
    if (read_message(datagram, &hello)) {
      greeted_ = true;
      answer(welcome(), memory_.fd());
      return;
    }
    if (read_header(datagram, &header) && header.version != kProtocolVersion) {
      refuse(peer_.get(), "the simulator speaks version " + std::to_string(kProtocolVersion) +
                              " of the protocol, the client version " + std::to_string(header.version) +
                              "; install both from one release");
    } else {
      refuse(peer_.get(), "that was no greeting");
    }
    peer_.reset();
  }

  void obey(std::span<const std::byte> datagram) {
    SetPose set_pose;
    Capture trigger;
    Release release;
    Goodbye goodbye;
    if (read_message(datagram, &set_pose)) {
      move_to(set_pose);
    } else if (read_message(datagram, &trigger)) {
      if (capture_wanted_) refuse(peer_.get(), "a capture is under way already");
      capture_wanted_ = true;
      left_alone_ = trigger.left_alone != 0;
    } else if (read_message(datagram, &release)) {
      give_back(release);
    } else if (read_message(datagram, &goodbye)) {
      end_ = ServeEnd::kGoodbye;
    } else {
      refuse(peer_.get(), "a datagram of " + std::to_string(datagram.size()) + " bytes is no message of this protocol");
    }
  }

  void move_to(const SetPose& order) {
    const Eigen::Isometry3d pose = read_pose(order.T_world_camera);
    if (!is_rigid(pose)) {
      refuse(peer_.get(), "the pose is not finite or not a rotation");
      return;
    }
    pose_ = pose;
    pose_id_ = order.pose_id;
    auto message = make_message<PoseSet>();
    message.pose_id = pose_id_;
    answer(message);
  }

  void give_back(const Release& order) {
    if (order.slot >= slot_sequence_.size() || order.sequence == 0 || slot_sequence_[order.slot] != order.sequence) {
      refuse(peer_.get(), "the client does not hold slot " + std::to_string(order.slot));
      return;
    }
    slot_sequence_[order.slot] = 0;
  }

  int free_slot() const {
    const auto found = std::find(slot_sequence_.begin(), slot_sequence_.end(), 0U);
    return found == slot_sequence_.end() ? -1 : static_cast<int>(found - slot_sequence_.begin());
  }

  void capture() {
    const auto slot = static_cast<std::size_t>(free_slot());
    capture_wanted_ = false;
    slot_sequence_[slot] = ++sequence_;
    auto message = make_message<Captured>();
    message.slot = static_cast<std::uint32_t>(slot);
    message.sequence = sequence_;
    message.pose_id = pose_id_;
    message.capture_time_ns = monotonic_ns();
    message.exposure_s = camera_.options().exposure_s;
    write_pose(pose_, &message.T_world_camera);
    camera_.capture(true_pose(), sequence_, memory_.left(slot),
                    left_alone_ ? std::span<std::uint8_t>{} : memory_.right(slot));
    answer(message);
  }

  /// Where the carrier has really brought the camera; the same for the same seed and exposure.
  Eigen::Isometry3d true_pose() const {
    if (options_.carrier_sigma_m == 0 && options_.carrier_sigma_rad == 0) return pose_;
    std::seed_seq seed{camera_.options().seed, sequence_};
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal;
    const auto draw = [&](double sigma) {
      const double x = sigma * normal(random), y = sigma * normal(random);
      return Eigen::Vector3d(x, y, sigma * normal(random));
    };
    const Eigen::Vector3d shift = draw(options_.carrier_sigma_m), turn = draw(options_.carrier_sigma_rad);
    Eigen::Isometry3d error = Eigen::Isometry3d::Identity();
    error.translation() = shift;
    if (turn.norm() > 0) error.linear() = Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix();
    return pose_ * error;
  }

  Welcome welcome() const {
    const CameraModel& model = camera_.options().camera;
    auto message = make_message<Welcome>();
    message.width = model.width;
    message.height = model.height;
    message.fx = model.fx;
    message.fy = model.fy;
    message.cx = model.cx;
    message.cy = model.cy;
    message.distortion = static_cast<std::int32_t>(model.distortion);
    std::copy(model.coefficients.begin(), model.coefficients.end(), message.coefficients);
    message.baseline_m = camera_.options().baseline_m;
    message.slots = static_cast<std::uint32_t>(slot_sequence_.size());
    message.slot_bytes = memory_.slot_bytes();
    message.right_offset = memory_.right_offset();
    return message;
  }

  template <typename Message>
  void answer(const Message& message, int attached = -1) {
    if (send_message(peer_.get(), message, attached)) return;
    // Of a client that has gone, there may be last words to read, such as a goodbye: then comes the connection's end.
    if (errno != EPIPE && errno != ECONNRESET) lose_peer();
  }

  void refuse(int socket, const std::string& reason) {
    auto message = make_message<Refused>();
    std::snprintf(message.reason, sizeof message.reason, "%s", reason.c_str());
    // A peer that can't be told has gone or does not listen; its end of the connection says so.
    send_message(socket, message);
  }

  const StereoCamera& camera_;
  ServerOptions options_;
  FrameMemory memory_;
  FileDescriptor stop_, listener_, peer_;
  struct stat socket_file_ {};

  bool greeted_ = false;
  SteadyClock::time_point connected_, waiting_since_;
  std::optional<ServeEnd> end_;

  Eigen::Isometry3d pose_;
  std::uint64_t pose_id_ = 0;
  std::uint64_t sequence_ = 0;
  bool capture_wanted_ = false;
  bool left_alone_ = false;                   // the capture that is wanted
  std::vector<std::uint64_t> slot_sequence_;  // of the frame that the client holds in each slot; 0: free
};

Server::Server(const StereoCamera& camera, const ServerOptions& options) {
  if (options.slots < 1 || options.slots > 64) throw std::invalid_argument("Server: slots must be 1 to 64");
  if (!is_rigid(options.first_pose)) throw std::invalid_argument("Server: the first pose is not rigid");
  if (!(options.carrier_sigma_m >= 0 && options.carrier_sigma_rad >= 0) || !std::isfinite(options.carrier_sigma_m) ||
      !std::isfinite(options.carrier_sigma_rad)) {
    throw std::invalid_argument("Server: the carrier's noise must be finite and not negative");
  }
  implementation_ = std::make_unique<Implementation>(camera, options);
}

Server::~Server() = default;
ServeEnd Server::run(int stop_fd) { return implementation_->run(stop_fd); }
void Server::stop() { implementation_->stop(); }

}  // namespace vantage::sim
