#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

#include <Eigen/Geometry>

#include "calib/camera_model.h"
#include "drivers/camera/frame_source.h"

namespace vantage::sim {

/// The simulator's stereo camera, seen from a robot's program: a free-flying pair that stands where `set_pose` puts it
/// and exposes when `next` asks (a software trigger).
///
/// Images are not copied: their pixels lie in memory shared with the simulator, which fills the slot again when the
/// last copy of a frame's `image.pixels` and `right_image.pixels` has gone. They stay readable after this object, and
/// after the simulator. The simulator has a few slots (4); who holds all of them gets no further frame: kTimeout.
///
/// `next`, `set_pose` and `connected` belong to one thread; frames may be dropped in any.
///
///     SimCamera camera("/tmp/vantage-sim");
///     camera.set_pose(T_world_camera);
///     Frame frame;
///     if (camera.next(&frame, std::chrono::seconds(2)) == FrameStatus::kFrame) ...
class SimCamera : public FrameSource {
 public:
  enum class Eyes { kBoth, kLeft };

  /// Connects and learns the camera; waits up to `patience` for a simulator that is still starting. kLeft leaves every
  /// frame's `right_image` empty and spares the simulator half of its work.
  /// \throws InputError: nobody serves there, it serves somebody else, or it speaks another version of the protocol.
  explicit SimCamera(const std::filesystem::path& socket,
                     std::chrono::milliseconds patience = std::chrono::milliseconds(5000), Eyes eyes = Eyes::kBoth);
  /// Says goodbye.
  ~SimCamera() override;
  SimCamera(const SimCamera&) = delete;
  SimCamera& operator=(const SimCamera&) = delete;

  /// Triggers an exposure and waits for it. After kTimeout the exposure is still under way, and the next call waits for
  /// the same one. Every frame shows the pose that was set last.
  FrameStatus next(Frame* frame, std::chrono::milliseconds timeout) override;
  std::string end_reason() const override { return end_reason_; }

  /// Moves the left camera and waits until the simulator has taken the pose. False, and nothing moves, when the pose is
  /// not rigid (is_rigid) or the simulator has gone (then `end_reason` says so).
  bool set_pose(const Eigen::Isometry3d& T_world_camera);

  /// True while the simulator is there; does not wait. Lets a program that has nothing to ask notice that it has gone.
  bool connected();

  /// Tells the simulator that nothing more is needed: it ends well. Later calls of `next` give kEnded.
  void goodbye();

  /// Of both cameras.
  const CameraModel& camera() const { return camera_; }
  /// The right camera stands at +baseline on the left one's x axis.
  double baseline_m() const { return baseline_m_; }

 private:
  class Connection;
  struct Reply;
  struct Slot;

  Reply receive(std::chrono::steady_clock::time_point deadline);
  FrameStatus end(const std::string& reason);
  bool deliver(const Reply& reply, Frame* frame);

  std::shared_ptr<Connection> connection_;
  CameraModel camera_;
  double baseline_m_ = 0;
  Eyes eyes_;
  std::uint64_t pose_id_ = 0;  // counts the poses set; what comes back with another is out of date
  bool capture_pending_ = false;
  std::string end_reason_;
};

}  // namespace vantage::sim
