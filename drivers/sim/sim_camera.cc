#include "drivers/sim/sim_camera.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <thread>
#include <utility>
#include <variant>

#include <fcntl.h>
#include <poll.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>

#include "calib/files/input_error.h"
#include "drivers/sim/protocol.h"
#include "drivers/sim/unix_socket.h"
#include "lcmtypes/link/depth_map.h"

namespace vantage::sim {
namespace {

using SteadyClock = std::chrono::steady_clock;

/// The simulator answers a pose at once, or after the picture it is just taking.
constexpr std::chrono::seconds kPoseAnswerLimit{10};

constexpr std::uint32_t kMostSlots = 64;
constexpr std::int32_t kLargestSide = 16384;

bool readable_before(int fd, SteadyClock::time_point deadline) {
  while (true) {
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline - SteadyClock::now());
    pollfd polled{fd, POLLIN, 0};
    const int ready = ::poll(&polled, 1, static_cast<int>(std::clamp<std::int64_t>(left.count(), 0, 1'000'000)));
    if (ready > 0) return true;
    if (ready < 0 && errno != EINTR) return true;  // the read that follows reports it
    if (SteadyClock::now() >= deadline) return false;
  }
}

CameraModel camera_of(const Welcome& welcome) {
  CameraModel camera{welcome.width, welcome.height, welcome.fx,        welcome.fy,
                     welcome.cx,    welcome.cy,     Distortion::kNone, {}};
  camera.distortion = static_cast<Distortion>(welcome.distortion);
  std::copy(std::begin(welcome.coefficients), std::end(welcome.coefficients), camera.coefficients.begin());
  return camera;
}

/// Whether the simulator's word makes sense: nothing read later lies outside the memory that it describes.
bool sensible(const Welcome& welcome, std::string* why) {
  if (welcome.width < 1 || welcome.width > kLargestSide || welcome.height < 1 || welcome.height > kLargestSide) {
    *why = "an image size of " + std::to_string(welcome.width) + " x " + std::to_string(welcome.height);
    return false;
  }
  if (welcome.distortion < 0 || welcome.distortion > static_cast<int>(Distortion::kEquidistant)) {
    *why = "an unknown lens";
    return false;
  }
  if (!camera_of(welcome).valid(why)) return false;
  const auto image = static_cast<std::uint64_t>(welcome.width) * static_cast<std::uint64_t>(welcome.height);
  if (welcome.slots < 1 || welcome.slots > kMostSlots || welcome.right_offset < image ||
      welcome.right_offset > 2 * image + 4096 || welcome.slot_bytes < welcome.right_offset + image ||
      welcome.slot_bytes > 4 * image + 8192) {
    *why = "slots that do not hold the images";
    return false;
  }
  if (!(std::isfinite(welcome.baseline_m) && welcome.baseline_m > 0)) {
    *why = "a baseline that is not positive";
    return false;
  }
  return true;
}

std::string text_of(const Refused& refused) {
  return {refused.reason, ::strnlen(refused.reason, sizeof refused.reason)};
}

}  // namespace

/// The socket and the shared memory: lives as long as the camera or any of its images.
class SimCamera::Connection {
 public:
  Connection(FileDescriptor socket, std::filesystem::path path) : socket_(std::move(socket)), path_(std::move(path)) {}
  ~Connection() {
    if (base_ != nullptr) ::munmap(const_cast<std::uint8_t*>(base_), total_);
  }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  int fd() const { return socket_.get(); }
  std::string name() const { return path_.string(); }
  const Welcome& layout() const { return layout_; }
  const std::uint8_t* slot(std::uint32_t slot) const { return base_ + slot * layout_.slot_bytes; }

  void map(const Welcome& layout, const FileDescriptor& memory) {
    layout_ = layout;
    total_ = layout.slots * layout.slot_bytes;
    struct stat status {};
    const int seals = memory.valid() ? ::fcntl(memory.get(), F_GET_SEALS) : -1;
    if (seals < 0 || (seals & F_SEAL_SHRINK) == 0 || ::fstat(memory.get(), &status) != 0 ||
        static_cast<std::uint64_t>(status.st_size) < total_) {
      throw InputError(name() + ": the simulator's shared memory is missing, too small or not sealed");
    }
    void* mapped = ::mmap(nullptr, total_, PROT_READ, MAP_SHARED, memory.get(), 0);
    if (mapped == MAP_FAILED) throw InputError(name() + ": mapping the frames failed: " + std::strerror(errno));
    base_ = static_cast<const std::uint8_t*>(mapped);
  }

  /// For any thread: one datagram is sent whole or not at all.
  void release(std::uint32_t slot, std::uint64_t sequence) const {
    auto message = make_message<Release>();
    message.slot = slot;
    message.sequence = sequence;
    send_message(fd(), message);
  }

 private:
  FileDescriptor socket_;
  std::filesystem::path path_;
  Welcome layout_;
  const std::uint8_t* base_ = nullptr;
  std::size_t total_ = 0;
};

struct SimCamera::Reply {
  std::variant<std::monostate, PoseSet, Captured, Refused> message;  // monostate: none in time
  std::string lost;                                                  // why none will come any more
};

/// A frame's place in the shared memory; both of its images own it together.
struct SimCamera::Slot {
  std::shared_ptr<const Connection> connection;
  std::uint32_t slot;
  std::uint64_t sequence;
  Slot(std::shared_ptr<const Connection> c, std::uint32_t index, std::uint64_t count)
      : connection(std::move(c)), slot(index), sequence(count) {}
  ~Slot() { connection->release(slot, sequence); }
  Slot(const Slot&) = delete;
  Slot& operator=(const Slot&) = delete;
};

SimCamera::SimCamera(const std::filesystem::path& socket, std::chrono::milliseconds patience, Eyes eyes) : eyes_(eyes) {
  const std::string name = socket.string();
  const auto deadline = SteadyClock::now() + patience;
  FileDescriptor connected = connect_to(socket);
  while (!connected.valid() && SteadyClock::now() < deadline) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    connected = connect_to(socket);
  }
  if (!connected.valid()) {
    throw InputError(name + ": no simulator serves there; start one with  vantage-sim --socket " + name +
                     " --object models/teapot.ply");
  }
  connection_ = std::make_shared<Connection>(std::move(connected), socket);
  send_message(connection_->fd(), make_message<Hello>());

  std::array<std::byte, kLongestMessage + 1> buffer;
  std::size_t size = 0;
  FileDescriptor memory;
  if (!readable_before(connection_->fd(), SteadyClock::now() + std::max(patience, std::chrono::milliseconds(2000))) ||
      receive_datagram(connection_->fd(), buffer, &size, &memory) != ReceiveStatus::kDatagram) {
    throw InputError(name + ": the program there does not answer as a simulator does");
  }
  const std::span<const std::byte> datagram(buffer.data(), size);
  Welcome welcome;
  Refused refused;
  MessageHeader header;
  std::string why;
  if (read_message(datagram, &refused)) throw InputError(name + ": " + text_of(refused));
  if (read_header(datagram, &header) && header.version != kProtocolVersion) {
    throw InputError(name + ": the simulator speaks version " + std::to_string(header.version) +
                     " of the protocol, this program version " + std::to_string(kProtocolVersion) +
                     "; install both from one release");
  }
  if (!read_message(datagram, &welcome)) throw InputError(name + ": the program there is no simulator");
  if (!sensible(welcome, &why)) throw InputError(name + ": the simulator announces " + why);
  connection_->map(welcome, memory);
  camera_ = camera_of(welcome);
  baseline_m_ = welcome.baseline_m;
}

SimCamera::~SimCamera() { goodbye(); }

void SimCamera::goodbye() {
  if (!end_reason_.empty()) return;
  send_message(connection_->fd(), make_message<Goodbye>());
  end_reason_ = "this program has said goodbye to the simulator";
}

FrameStatus SimCamera::end(const std::string& reason) {
  if (end_reason_.empty()) end_reason_ = reason;
  return FrameStatus::kEnded;
}

SimCamera::Reply SimCamera::receive(SteadyClock::time_point deadline) {
  const std::string socket = " (socket " + connection_->name() + ")";
  std::array<std::byte, kLongestMessage + 1> buffer;
  std::size_t size = 0;
  Reply reply;
  if (!readable_before(connection_->fd(), deadline)) return reply;
  switch (receive_datagram(connection_->fd(), buffer, &size)) {
    case ReceiveStatus::kNothingYet:
      return reply;
    case ReceiveStatus::kClosed:
      reply.lost = "the simulator has gone" + socket;
      return reply;
    case ReceiveStatus::kDatagram:
      break;
  }
  const std::span<const std::byte> datagram(buffer.data(), size);
  PoseSet pose_set;
  Captured captured;
  Refused refused;
  if (read_message(datagram, &pose_set)) {
    reply.message = pose_set;
  } else if (read_message(datagram, &captured) && captured.slot < connection_->layout().slots &&
             is_rigid(read_pose(captured.T_world_camera)) && std::isfinite(captured.exposure_s)) {
    reply.message = captured;
  } else if (read_message(datagram, &refused)) {
    reply.message = refused;
  } else {
    reply.lost = "the simulator sent what is no message of its protocol" + socket;
  }
  return reply;
}

FrameStatus SimCamera::next(Frame* frame, std::chrono::milliseconds timeout) {
  const auto deadline = SteadyClock::now() + timeout;
  while (end_reason_.empty()) {
    if (!capture_pending_) {
      // Should it fail, the simulator has gone, and `receive` finds the end of the connection.
      auto trigger = make_message<Capture>();
      trigger.left_alone = eyes_ == Eyes::kLeft ? 1 : 0;
      send_message(connection_->fd(), trigger);
      capture_pending_ = true;
    }
    const Reply reply = receive(deadline);
    if (!reply.lost.empty()) return end(reply.lost);
    if (const auto* refused = std::get_if<Refused>(&reply.message)) {
      return end("the simulator refused: " + text_of(*refused) + " (socket " + connection_->name() + ")");
    }
    if (deliver(reply, frame)) return FrameStatus::kFrame;
    if (SteadyClock::now() >= deadline) return FrameStatus::kTimeout;
  }
  return FrameStatus::kEnded;
}

/// True when the reply was a frame of the present pose. One of an earlier pose goes back at once.
bool SimCamera::deliver(const Reply& reply, Frame* frame) {
  const auto* captured = std::get_if<Captured>(&reply.message);
  if (captured == nullptr) return false;
  capture_pending_ = false;
  const auto slot = std::make_shared<const Slot>(connection_, captured->slot, captured->sequence);
  if (captured->pose_id != pose_id_ || frame == nullptr) return false;
  const Welcome& layout = connection_->layout();
  const std::uint8_t* left = connection_->slot(captured->slot);
  frame->capture_time_ns = captured->capture_time_ns;
  frame->sequence = captured->sequence;
  frame->exposure_s = captured->exposure_s;
  frame->image = {layout.width, layout.height, layout.width, {slot, left}};
  frame->right_image = {};
  if (eyes_ == Eyes::kBoth) {
    frame->right_image = {layout.width, layout.height, layout.width, {slot, left + layout.right_offset}};
  }
  frame->T_world_camera = read_pose(captured->T_world_camera);
  return true;
}

bool SimCamera::set_pose(const Eigen::Isometry3d& T_world_camera) {
  if (!is_rigid(T_world_camera) || !end_reason_.empty()) return false;
  auto order = make_message<SetPose>();
  order.pose_id = ++pose_id_;
  write_pose(T_world_camera, &order.T_world_camera);
  send_message(connection_->fd(), order);
  const auto deadline = SteadyClock::now() + kPoseAnswerLimit;
  while (SteadyClock::now() < deadline) {
    const Reply reply = receive(deadline);
    if (!reply.lost.empty()) {
      end(reply.lost);
      return false;
    }
    if (const auto* set = std::get_if<PoseSet>(&reply.message)) {
      if (set->pose_id == pose_id_) return true;
    } else if (std::holds_alternative<Refused>(reply.message)) {
      --pose_id_;  // the pose before still holds
      return false;
    } else {
      deliver(reply, nullptr);  // a frame that was under way, of the pose before
    }
  }
  end("the simulator does not answer (socket " + connection_->name() + ")");
  return false;
}

bool SimCamera::connected() {
  if (!end_reason_.empty()) return false;
  pollfd polled{connection_->fd(), POLLIN, 0};
  std::byte first{};
  // Replies that wait to be read keep the connection from looking closed; `next` takes them.
  if (::poll(&polled, 1, 0) > 0 && ::recv(connection_->fd(), &first, 1, MSG_PEEK | MSG_DONTWAIT) <= 0) {
    end("the simulator has gone (socket " + connection_->name() + ")");
    return false;
  }
  return true;
}

}  // namespace vantage::sim
