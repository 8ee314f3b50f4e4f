#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "drivers/camera/frame_source.h"
#include "drivers/robot/camera_carrier.h"

namespace vantage {

/// A small stereo camera on a carrier that goes wherever it is put. Its images are noise-free stripes.
class FakeRobot final : public FrameSource, public CameraCarrier {
 public:
  static CameraModel camera() { return {128, 48, 100, 100, 64, 24, Distortion::kNone, {}}; }
  static constexpr double kBaseline_m = 0.1;

  FrameStatus next(Frame* frame, std::chrono::milliseconds) override {
    const std::lock_guard lock(mutex_);
    if (!end_reason_.empty()) return FrameStatus::kEnded;
    const CameraModel model = camera();
    auto pixels = std::make_shared<std::vector<std::uint8_t>>(static_cast<std::size_t>(model.width * model.height));
    for (std::size_t i = 0; i < pixels->size(); ++i)
      (*pixels)[i] = static_cast<std::uint8_t>(i * i * 2654435761u >> 24);
    *frame = Frame{};
    frame->capture_time_ns = ++exposures_ * 1000;
    frame->sequence = static_cast<std::uint64_t>(exposures_);
    frame->exposure_s = 0.01;
    frame->image = {model.width, model.height, model.width, {pixels, pixels->data()}};
    frame->T_world_camera = pose_;
    frame->right_image = frame->image;
    return FrameStatus::kFrame;
  }
  std::string end_reason() const override {
    const std::lock_guard lock(mutex_);
    return end_reason_;
  }
  bool set_pose(const Eigen::Isometry3d& pose) override {
    const std::lock_guard lock(mutex_);
    pose_ = pose;
    path_.push_back(pose);
    return end_reason_.empty();
  }
  bool alive() override {
    const std::lock_guard lock(mutex_);
    return end_reason_.empty();
  }

  void vanish(const std::string& reason) {
    const std::lock_guard lock(mutex_);
    end_reason_ = reason;
  }
  std::vector<Eigen::Isometry3d> path() const {
    const std::lock_guard lock(mutex_);
    return path_;
  }
  int exposures() const { return static_cast<int>(exposures_); }

 private:
  mutable std::mutex mutex_;  // guards the rest: the executive's thread and the test's
  Eigen::Isometry3d pose_ = Eigen::Isometry3d::Identity();
  std::vector<Eigen::Isometry3d> path_;
  std::string end_reason_;
  std::atomic<std::int64_t> exposures_ = 0;
};

}  // namespace vantage
