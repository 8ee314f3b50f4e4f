#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include <Eigen/Geometry>

#include "calib/camera_model.h"
#include "drivers/camera/frame_source.h"
#include "lcmtypes/link/depth_map.h"
#include "onboard/depth/depth_backend.h"
#include "onboard/depth/depth_options.h"
#include "onboard/depth/key_frame_policy.h"
#include "onboard/depth/pose_refinement.h"

namespace vantage {

/// An image and where it was taken from.
struct PosedImage {
  std::int64_t capture_time_ns = 0;
  GreyImage image;  ///< without lens distortion
  Eigen::Isometry3d T_world_camera = Eigen::Isometry3d::Identity();
  /// Covariance of the pose, perturbed on the right: T exp(d), d = (shift in m, turn in rad) along the camera's axes.
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
};

/// What the filter made of a frame. All but kUsed leave its state as it was.
enum class FrameUse {
  kUsed,
  kNoKeyFrame,  ///< nothing was started yet
  kWrongSize,   ///< image and camera have different sizes, or there is no image
  kBadPose,     ///< pose or covariance not finite, not a rotation, or variances negative
  kOutOfOrder   ///< not later than the last frame
};
inline constexpr int kFrameUses = 5;

/// Depth of one key frame after another, per pixel, from the frames that follow it (REMODE's way: Pizzoli, Forster and
/// Scaramuzza, ICRA 2014; over inverse depth).
///
///     DepthFilter filter(camera, options, std::make_unique<CpuDepthBackend>(...));
///     filter.start(key_frame);
///     while (... frame ...) {
///       filter.update(frame);
///       if (filter.key_frame_end() != KeyFrameEnd::kNotYet) { send(filter.depth_map()); filter.advance(frame); }
///     }
class DepthFilter {
 public:
  /// \pre `options` are valid and `camera` is without distortion. `backend` is for the camera's image size.
  DepthFilter(const CameraModel& camera, const DepthFilterOptions& options, const KeyFrameOptions& key_frames,
              std::unique_ptr<DepthBackend> backend, WorkerPool* pool);
  ~DepthFilter();

  /// Begins a key frame with the prior alone.
  FrameUse start(const PosedImage& key_frame);

  /// Begins a key frame with what is believed now, carried over to it. It may be the frame that `update` was last
  /// given. Pixels that nothing is carried to begin with the prior. Without an earlier key frame the same as `start`.
  FrameUse advance(const PosedImage& key_frame);

  /// Takes one more frame into account.
  FrameUse update(const PosedImage& frame);

  /// Whether the key frame has done its duty, and why.
  KeyFrameEnd key_frame_end() const { return policy_.end(); }

  const UpdateCounts& counts() const { return counts_; }                 ///< of the last update
  int frames() const { return frames_; }                                 ///< used since the key frame began
  std::uint64_t refused() const { return refused_; }                     ///< frames, in all
  const Eigen::Isometry3d& T_frame_key() const { return T_frame_key_; }  ///< of the last update, as it was refined

  /// The key frame's depth as it stands. kConverged where the filter is sure; kUpdating where a match has told
  /// something; kDiverged where it gave up; kInvalid elsewhere. Identifiers are left 0, `utime` is the capture time.
  DepthMap depth_map() const;

  /// States and beliefs as they stand, row-major.
  void read(std::vector<PixelBelief>* beliefs, std::vector<PixelState>* states) const;

 private:
  FrameUse check(const PosedImage& frame) const;
  void begin(const PosedImage& key_frame, double scale_sigma);
  void carry(const Eigen::Isometry3d& T_new_key, double scale);

  CameraModel camera_;
  DepthFilterOptions options_;
  std::unique_ptr<DepthBackend> backend_;
  KeyFramePolicy policy_;
  std::unique_ptr<PoseRefinement> refinement_;  ///< none when poses are taken as they come

  std::optional<PosedImage> key_;
  std::int64_t last_time_ns_ = 0;
  Eigen::Isometry3d T_frame_key_ = Eigen::Isometry3d::Identity();
  UpdateCounts counts_;
  int frames_ = 0;
  std::uint64_t refused_ = 0;
  std::vector<PixelBelief> beliefs_;  ///< to begin with; room kept
};

}  // namespace vantage
