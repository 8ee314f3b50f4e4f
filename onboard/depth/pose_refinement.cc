#include "onboard/depth/pose_refinement.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include <Eigen/Dense>

#include "onboard/depth/corner_tracks.h"
#include "onboard/depth/epipolar_line.h"
#include "onboard/depth/gauge_scale.h"
#include "onboard/depth/image_pyramid.h"
#include "onboard/depth/pose_noise.h"
#include "onboard/depth/window_adjustment.h"

namespace vantage {
namespace {

using Eigen::Isometry3d;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

constexpr int kCorners = 300;
constexpr int kLeastCorners = 20;
constexpr std::size_t kAnchors = kMostPoses - 1;  // frames that the adjustment keeps beside the newest
constexpr double kCornerSigma_px = 0.1;           // of align_corners on images with noise of two grey levels
constexpr double kFirstSigma_px = 0.5;            // until the first frame has told
// What no pose explains (lens, rolling shutter) is alike in corners that are near each other: however many are found,
// so many err independently of each other.
constexpr double kIndependentCorners = 20;
constexpr double kShiftFloor_m = 1e-5, kTurnFloor_rad = 1e-5;  // no pose is given better
constexpr double kLargestOffset_px = 5;
constexpr double kKnownRelativeSigma = 0.1;  // of a corner's inverse depth that is carried over
constexpr double kEnoughScaleSigma = 0.08;
constexpr std::size_t kTellingViews = 4;  // of how good given poses are
constexpr double kHoldingSigma = 0.01;    // of the unit of length, as given poses must keep it to hold it
// Over the inverse depths that are possible: so wide that hundreds of corners, each expected in the middle of them, do
// not outvote the poses on the unit of length.
constexpr double kPriorWidth = 3;
constexpr int kMostRounds = 4;  // of adjusting and judging the poses' noise, a frame

/// A frame, as it came and as it is adjusted.
struct View {
  Isometry3d given = Isometry3d::Identity();      ///< metres
  Matrix6d information = Matrix6d::Zero();        ///< of `given`, as stated
  Matrix3d shift_information = Matrix3d::Zero();  ///< of its translation alone
  AdjustedView adjusted;                          ///< gauge units
};

}  // namespace

struct PoseRefinement::State {
  State(const CameraModel& c, const DepthFilterOptions& options, WorkerPool* p)
      : camera(c),
        pool(p),
        prior_mean(0.5 * (1 / options.min_depth_m + 1 / options.max_depth_m)),
        prior_sigma(kPriorWidth * options.inverse_range()),
        adjustment(c, 0.5 / options.max_depth_m, 2 / options.min_depth_m),
        key_image(c.width, c.height),
        image(c.width, c.height) {
    for (auto* corner_values : {&before, &found, &ratios}) corner_values->reserve(kCorners);
    adjustment.reserve(kCorners);
    corners_px.reserve(kCorners);
    corners.reserve(kCorners);
    offsets.reserve(kCorners);
    for (View& view : views) view.adjusted.places.reserve(kCorners);
  }

  View& newest() { return views[anchors]; }
  /// The anchors and the newest, for the adjustment.
  std::span<AdjustedView* const> adjusted() const { return {pointers.data(), anchors + 1}; }

  Vector2d project(const Isometry3d& T, const AdjustedCorner& corner) const {
    const Vector3d P = T.linear() * corner.ray + corner.inverse * T.translation();
    return {camera.fx * P.x() / P.z() + camera.cx, camera.fy * P.y() / P.z() + camera.cy};
  }

  void set_prior(View* view) const;
  void find_places(View* view);
  void adjust();
  void adjust_from_given_too();
  void weigh_misfit();
  void remember(std::vector<double>* inverses) const;
  double given_unit_sigma() const;
  void keep_gauge();
  void follow_unit();
  void choose_gauge();
  void keep_anchors_apart();

  CameraModel camera;
  WorkerPool* pool;
  double prior_mean, prior_sigma;  ///< of a corner's inverse depth that nothing is known of, 1/m
  WindowAdjustment adjustment;
  ImagePyramid key_image, image;

  std::vector<Eigen::Vector2f> corners_px;
  std::vector<AdjustedCorner> corners;
  std::vector<Vector2d> offsets;  ///< of the last place each was found at from where it was expected
  std::array<View, kMostPoses> views;
  std::size_t anchors = 0;  ///< the first of `views`; then the newest, then room
  std::array<AdjustedView*, kMostPoses> pointers = {};

  PoseNoise noise;  ///< kept from key frame to key frame: the poses come from the same source
  PoseEvidence evidence;
  GaugeScale unit;

  bool gauge = false;                   ///< chosen: lengths keep their unit from now on
  bool held_by_poses = false;           ///< it is a metre, and the given poses keep it better than the corners could
  double pixel_sigma = kFirstSigma_px;  ///< that the adjustment weighs corners with
  double misfit_px = 0;

  // Room, kept from frame to frame.
  std::vector<double> before, found, ratios;
  std::array<Isometry3d, kMostPoses> found_poses;
};

PoseRefinement::PoseRefinement(const CameraModel& camera, const DepthFilterOptions& options, WorkerPool* pool)
    : state_(std::make_unique<State>(camera, options, pool)) {
  for (std::size_t i = 0; i < kMostPoses; ++i) state_->pointers[i] = &state_->views[i].adjusted;
}

PoseRefinement::~PoseRefinement() = default;

void PoseRefinement::begin(const GreyImage& key_image, const Matrix6d& key_covariance,
                           std::span<const PixelBelief> beliefs, double scale_sigma) {
  State& s = *state_;
  s.key_image.build(key_image);
  find_corners(s.key_image, kCorners, &s.corners_px);
  s.corners.clear();
  std::size_t known = 0;
  for (const Eigen::Vector2f& px : s.corners_px) {
    AdjustedCorner corner{.ray = {(px.x() - s.camera.cx) / s.camera.fx, (px.y() - s.camera.cy) / s.camera.fy, 1},
                          .inverse = s.prior_mean,
                          .prior_mean = s.prior_mean,
                          .prior_sigma = s.prior_sigma};
    const PixelBelief& belief = beliefs[static_cast<std::size_t>(px.y()) * static_cast<std::size_t>(s.camera.width) +
                                        static_cast<std::size_t>(px.x())];
    if (belief.variance < kKnownRelativeSigma * kKnownRelativeSigma * belief.mean * belief.mean) {
      corner.inverse = corner.prior_mean = belief.mean;
      corner.prior_sigma = std::sqrt(belief.variance);
      ++known;
    }
    s.corners.push_back(corner);
  }
  s.offsets.assign(s.corners.size(), Vector2d::Zero());
  s.anchors = 0;
  s.gauge = 2 * known > s.corners.size();
  s.held_by_poses = s.held_by_poses && s.gauge;
  s.unit.begin(key_covariance.topLeftCorner<3, 3>(), s.gauge ? scale_sigma : 0);
  s.pixel_sigma = kFirstSigma_px;
}

/// The given pose in gauge units: the key frame's error taken out, lengths divided by the scale; as good as such poses
/// have turned out to be.
void PoseRefinement::State::set_prior(View* view) const {
  const double metres = gauge ? unit.scale() : 1;
  AdjustedView& adjusted = view->adjusted;
  adjusted.prior = view->given;
  adjusted.prior.translation() = (view->given.translation() - view->given.linear() * unit.key_error()) / metres;
  Eigen::Matrix<double, 6, 1> factor;
  factor << Vector3d::Constant(metres / std::sqrt(noise.shift())), Vector3d::Constant(1 / std::sqrt(noise.turn()));
  adjusted.information = factor.asDiagonal() * view->information * factor.asDiagonal();
}

/// Looks for every corner in the image, about where the view's pose puts it, as it should look from there.
void PoseRefinement::State::find_places(View* view) {
  PairGeometry geometry;
  geometry.fx = static_cast<float>(camera.fx);
  geometry.fy = static_cast<float>(camera.fy);
  geometry.cx = static_cast<float>(camera.cx);
  geometry.cy = static_cast<float>(camera.cy);
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) geometry.rotation[3 * i + k] = static_cast<float>(view->adjusted.T.linear()(i, k));
    geometry.translation[i] = static_cast<float>(view->adjusted.T.translation()(i));
  }
  view->adjusted.places.assign(corners.size(), {});
  for (std::size_t k = 0; k < corners.size(); ++k) {
    PatchPlace& place = view->adjusted.places[k];
    place.position = (project(view->adjusted.T, corners[k]) + offsets[k]).cast<float>();
    EpipolarLine line;
    if (epipolar_line(geometry, corners_px[k].x(), corners_px[k].y(), static_cast<float>(corners[k].inverse), &line)) {
      place.to_key << line.to_key[0], line.to_key[1], line.to_key[2], line.to_key[3];
    }
  }
  align_corners(key_image, image, corners_px, pool, &view->adjusted.places);
}

void PoseRefinement::State::remember(std::vector<double>* inverses) const {
  inverses->clear();
  for (const AdjustedCorner& corner : corners) inverses->push_back(corner.inverse);
}

/// Poses and corners from all views kept and the newest, in turn with how good the given poses are: what is stated of
/// them is an upper bound, and with exact poses taken for no better than that, the unit of length is known no better.
void PoseRefinement::State::adjust() {
  remember(&before);
  for (int round = 0; round < kMostRounds; ++round) {
    for (std::size_t i = 0; i <= anchors; ++i) set_prior(&views[i]);
    if (gauge) {
      adjustment.run(adjusted(), corners, pixel_sigma, 5);
    } else {
      adjust_from_given_too();
    }
    adjustment.weigh(adjusted(), &evidence);
    if (!noise.judge(evidence)) break;
  }
  // What many corners have in common (lens, rolling shutter) holds for their depths too.
  const double corners_sigma = adjustment.corner_sigma(corners) / std::sqrt(kIndependentCorners);
  const bool poses_hold = given_unit_sigma() < std::min(corners_sigma, kHoldingSigma);
  held_by_poses = poses_hold && (held_by_poses || !gauge);
  if (gauge && !held_by_poses) keep_gauge();
  weigh_misfit();
}

/// Until the gauge is chosen each frame also tries the poses as given with corners that fit them: with little parallax
/// a wrong scene, inside out, may fit nearly as well as the true one, and one does not come from there to the other in
/// small steps.
void PoseRefinement::State::adjust_from_given_too() {
  const double cost = adjustment.run(adjusted(), corners, pixel_sigma, 10);
  remember(&found);
  for (std::size_t i = 0; i <= anchors; ++i) {
    found_poses[i] = views[i].adjusted.T;
    views[i].adjusted.T = views[i].adjusted.prior;
  }
  for (AdjustedCorner& corner : corners) corner.inverse = corner.prior_mean;
  adjustment.run_structure(adjusted(), corners, pixel_sigma, 4);
  if (adjustment.run(adjusted(), corners, pixel_sigma, 8) <= cost) return;
  for (std::size_t i = 0; i <= anchors; ++i) views[i].adjusted.T = found_poses[i];
  for (std::size_t k = 0; k < corners.size(); ++k) corners[k].inverse = found[k];
  adjustment.run(adjusted(), corners, pixel_sigma, 1);
}

/// What no pose explains, and what a corner counts for beside it.
void PoseRefinement::State::weigh_misfit() {
  const double residual_sigma = adjustment.residual_sigma(adjusted(), corners);
  misfit_px = std::sqrt(std::max(0.0, residual_sigma * residual_sigma - 2 * kCornerSigma_px * kCornerSigma_px));
  const std::vector<PatchPlace>& places = newest().adjusted.places;
  const auto seen = static_cast<double>(
      std::count_if(places.begin(), places.end(), [](const PatchPlace& place) { return place.found; }));
  pixel_sigma = std::hypot(kCornerSigma_px, misfit_px * std::sqrt(std::max(1.0, seen / kIndependentCorners)));
}

/// Relative standard deviation that the unit of length has by the given places of the views alone.
double PoseRefinement::State::given_unit_sigma() const {
  double information = 0;
  for (std::size_t i = 0; i <= anchors; ++i) {
    const Vector3d metres = unit.scale() * views[i].adjusted.T.translation();
    information += metres.dot(views[i].shift_information * metres);
  }
  return std::sqrt(noise.shift() / information);
}

/// Undoes what the adjustment changed of all corners' depths alike: the gauge is theirs.
void PoseRefinement::State::keep_gauge() {
  ratios.clear();
  for (std::size_t k = 0; k < corners.size(); ++k) {
    if (newest().adjusted.places[k].found) ratios.push_back(corners[k].inverse / before[k]);
  }
  if (ratios.empty()) return;
  const auto median = ratios.begin() + static_cast<std::ptrdiff_t>(ratios.size() / 2);
  std::nth_element(ratios.begin(), median, ratios.end());
  const double grown = *median;
  for (AdjustedCorner& corner : corners) corner.inverse /= grown;
  for (std::size_t i = 0; i <= anchors; ++i) views[i].adjusted.T.translation() *= grown;
}

/// How long the unit is, by all frames' given places; and whether that is known well enough to begin to measure.
void PoseRefinement::State::follow_unit() {
  // Until there is a gauge the whole window is adjusted anew: earlier places are out of date.
  if (!gauge) unit.forget_frames();
  for (std::size_t i = gauge ? anchors : 0; i <= anchors; ++i) {
    unit.add(views[i].adjusted.T, views[i].given.translation(), views[i].shift_information);
  }
  if (gauge && held_by_poses) {
    unit.follow_sigma(noise.shift());
  } else {
    unit.follow(noise.shift());
  }
  const bool known = unit.sigma() < kEnoughScaleSigma * unit.scale();
  if (!gauge && known && (held_by_poses || anchors + 1 >= kTellingViews)) choose_gauge();
}

/// From here on the unit of length stays: a metre, as well as it is known now.
void PoseRefinement::State::choose_gauge() {
  gauge = true;
  if (held_by_poses) {
    unit.hold_metre();
    return;
  }
  const double metres = unit.make_unit_a_metre();
  for (std::size_t i = 0; i <= anchors; ++i) views[i].adjusted.T.translation() *= metres;
  for (AdjustedCorner& corner : corners) {
    corner.inverse /= metres;
    corner.prior_mean /= metres;
    corner.prior_sigma /= metres;
  }
}

/// The newest becomes an anchor; when that is one too many the one nearest to an earlier one goes.
void PoseRefinement::State::keep_anchors_apart() {
  if (anchors < kAnchors) {
    ++anchors;
    return;
  }
  std::size_t least = 0;
  double least_distance = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i <= anchors; ++i) {
    for (std::size_t k = 0; k < i; ++k) {
      const double distance = (views[i].adjusted.T.translation() - views[k].adjusted.T.translation()).norm();
      if (distance < least_distance) {
        least_distance = distance;
        least = i;
      }
    }
  }
  std::rotate(views.begin() + static_cast<std::ptrdiff_t>(least),
              views.begin() + static_cast<std::ptrdiff_t>(least) + 1, views.end());
}

RefinedPose PoseRefinement::refine(const GreyImage& image, const Isometry3d& T_frame_key,
                                   const Matrix6d& frame_covariance) {
  State& s = *state_;
  s.image.build(image);
  View& view = s.newest();
  view.given = T_frame_key;
  Matrix6d covariance = frame_covariance;
  covariance.diagonal().head<3>().array() += kShiftFloor_m * kShiftFloor_m;
  covariance.diagonal().tail<3>().array() += kTurnFloor_rad * kTurnFloor_rad;
  view.information = covariance.inverse();
  view.shift_information = covariance.topLeftCorner<3, 3>().inverse();
  s.set_prior(&view);
  view.adjusted.T = view.adjusted.prior;
  s.find_places(&view);

  RefinedPose refined;
  refined.T_frame_key = view.adjusted.T;
  refined.covariance = covariance;
  for (const PatchPlace& place : view.adjusted.places) refined.corners += place.found ? 1 : 0;
  if (refined.corners < kLeastCorners) {
    refined.has_parallax = s.gauge;
    return refined;
  }
  s.adjust();
  refined.covariance = s.adjustment.last_covariance();
  for (std::size_t k = 0; k < s.corners.size(); ++k) {
    if (!view.adjusted.places[k].found) continue;
    s.offsets[k] = view.adjusted.places[k].position.cast<double>() - s.project(view.adjusted.T, s.corners[k]);
    if (s.offsets[k].norm() > kLargestOffset_px) s.offsets[k].setZero();
  }
  s.follow_unit();
  refined.T_frame_key = view.adjusted.T;
  refined.has_parallax = s.gauge;
  refined.misfit_px = s.misfit_px;
  s.keep_anchors_apart();
  return refined;
}

double PoseRefinement::scale() const { return state_->gauge ? state_->unit.scale() : 1; }
double PoseRefinement::scale_sigma() const { return state_->gauge ? state_->unit.sigma() : 0; }
PoseRefinement::Noise PoseRefinement::noise() const { return {state_->noise.shift(), state_->noise.turn()}; }

}  // namespace vantage
