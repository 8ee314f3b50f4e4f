#pragma once

#include <array>
#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <thread>

#include <poll.h>

#include "box.h"
#include "calib/look_at.h"
#include "drivers/sim/protocol.h"
#include "drivers/sim/server.h"
#include "drivers/sim/unix_socket.h"
#include "scratch_folder.h"

namespace vantage::sim {

inline StereoCamera small_stereo_camera() {
  World world;
  world.object = Box{{-0.15, -0.1, 0}, {0.15, 0.1, 0.2}}.mesh();
  StereoOptions options;
  options.camera = {94, 60, 56, 56, 46.5, 29.5, Distortion::kNone, {}};
  return {std::make_shared<Renderer>(world, 1), options};
}

/// A server with a small camera, in a thread of its own.
class Serving {
 public:
  explicit Serving(int slots = 4, bool keep_serving = false) : Serving(with(slots, keep_serving)) {}
  /// The socket and the first pose are its own.
  explicit Serving(ServerOptions options) {
    options.socket = path();
    options.first_pose = look_at({0.6, 0, 0.35}, {0, 0, 0.1});
    server_ = std::make_unique<Server>(camera_, options);
    thread_ = std::thread([this] { end_ = server_->run(); });
  }
  ~Serving() { vanish(); }

  std::filesystem::path path() const { return folder_ / "sim"; }
  const StereoCamera& camera() const { return camera_; }

  /// Waits until it ends by itself.
  ServeEnd join() {
    thread_.join();
    return *end_;
  }

  /// Ends it as if it were killed: the client's connection just closes.
  void vanish() {
    if (thread_.joinable()) {
      server_->stop();
      thread_.join();
    }
    server_.reset();
  }

 private:
  static ServerOptions with(int slots, bool keep_serving) {
    ServerOptions options;
    options.slots = slots;
    options.keep_serving = keep_serving;
    return options;
  }

  ScratchFolder folder_;
  StereoCamera camera_ = small_stereo_camera();
  std::unique_ptr<Server> server_;
  std::optional<ServeEnd> end_;
  std::thread thread_;
};

/// A client or a simulator that says whatever a test wants.
class RawPeer {
 public:
  explicit RawPeer(FileDescriptor socket) : socket_(std::move(socket)) {}
  explicit RawPeer(const std::filesystem::path& path) : socket_(connect_to(path)) {}

  int fd() const { return socket_.get(); }
  void close() { socket_.reset(); }

  template <typename Message>
  bool say(const Message& message, int attached = -1) {
    return send_message(socket_.get(), message, attached);
  }
  bool say_bytes(const std::string& bytes) {
    return send_datagram(socket_.get(), std::as_bytes(std::span(bytes.data(), bytes.size())));
  }

  /// The next datagram if it is one of this kind; empty at the end of the connection, or when none comes.
  template <typename Message>
  std::optional<Message> hear() {
    Message message;
    std::array<std::byte, kLongestMessage + 1> buffer;
    std::size_t size = 0;
    if (!wait() || receive_datagram(socket_.get(), buffer, &size) != ReceiveStatus::kDatagram) return {};
    if (!read_message(std::span<const std::byte>(buffer.data(), size), &message)) return {};
    return message;
  }

  bool closed() {
    std::array<std::byte, kLongestMessage + 1> buffer;
    std::size_t size = 0;
    return wait() && receive_datagram(socket_.get(), buffer, &size) == ReceiveStatus::kClosed;
  }

  bool greet() { return say(make_message<Hello>()) && hear<Welcome>().has_value(); }

 private:
  bool wait() const {
    pollfd polled{socket_.get(), POLLIN, 0};
    return ::poll(&polled, 1, 5000) > 0;
  }

  FileDescriptor socket_;
};

}  // namespace vantage::sim
