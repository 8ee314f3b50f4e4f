#pragma once

#include <chrono>
#include <filesystem>
#include <memory>
#include <optional>

#include "drivers/sim/stereo_camera.h"

namespace vantage::sim {

struct ServerOptions {
  std::filesystem::path socket;
  int slots = 4;                                                 ///< frames that a client may hold at once; 1 to 64
  std::optional<std::chrono::seconds> wait;                      ///< longest wait for the first client; empty: for ever
  bool keep_serving = false;                                     ///< a lost client may be followed by another
  Eigen::Isometry3d first_pose = Eigen::Isometry3d::Identity();  ///< T_world_left until the client sets one
  /// How far the camera stands from where its carrier says, as with an arm: standard deviation of each coordinate,
  /// drawn anew for every exposure. Frames tell the carrier's pose, not the true one.
  double carrier_sigma_m = 0, carrier_sigma_rad = 0;
};

/// Why a server ended.
enum class ServeEnd {
  kGoodbye,     ///< its client needs no more
  kStopped,     ///< `stop()` or the stop descriptor
  kClientLost,  ///< its client vanished without a goodbye, and none may follow
  kNobodyCame   ///< no client within `ServerOptions::wait`
};

/// Serves one client with frames of a stereo camera (protocol.h, docs/simulator.md), in the thread that calls `run`.
///
/// A peer counts as the client once it has greeted in the right version; until then it may come and go, and others may
/// follow. While a client is served, further ones are refused. Everything received is checked: datagrams of the wrong
/// length, version or kind, poses that are not rigid, and slots that the client does not hold, are refused with a
/// reason and change nothing.
class Server {
 public:
  /// Listens from here on. \throws InputError (see listen_at); std::invalid_argument on bad options.
  Server(const StereoCamera& camera, const ServerOptions& options);
  /// Removes the socket's file.
  ~Server();

  /// Until the end. `stop_fd`, when not negative, ends it by becoming readable (a signalfd).
  ServeEnd run(int stop_fd = -1);

  /// Ends `run` soon; for any thread.
  void stop();

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace vantage::sim
