#pragma once

#include "drivers/camera/stereo_depth.h"
#include "onboard/executive/view_depth.h"

namespace vantage {

/// Depth from a single exposure of a stereo pair.
class StereoView final : public ViewDepth {
 public:
  /// `matcher` must outlive it.
  explicit StereoView(StereoDepth& matcher) : matcher_(matcher) {}

  bool fits(const Frame& frame, std::string* why) override {
    DepthMap ignored;
    return matcher_.compute(frame, &ignored, why);
  }
  bool watches_the_way() const override { return false; }
  void pass(const Frame&) override {}
  void begin(const Frame& key) override { key_ = key; }
  std::optional<Eigen::Isometry3d> next_pose() override { return {}; }
  void add(const Frame&) override {}
  bool finish(DepthMap* map, std::string* why) override {
    const bool measured = matcher_.compute(key_, map, why);
    key_ = {};
    return measured;
  }

 private:
  StereoDepth& matcher_;
  Frame key_;
};

}  // namespace vantage
