#include "onboard/depth/pose_refinement.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include <Eigen/Dense>

#include "onboard/depth/corner_tracks.h"
#include "onboard/depth/epipolar_line.h"
#include "onboard/depth/image_pyramid.h"
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
constexpr std::size_t kAnchors = 10;     // frames that the adjustment keeps beside the newest
constexpr double kCornerSigma_px = 0.1;  // of align_corners on images with noise of two grey levels
// What no pose explains (lens, rolling shutter) is alike in corners that are near each other: however many are found,
// so many err independently of each other.
constexpr double kIndependentCorners = 20;
constexpr double kShiftFloor_m = 1e-5, kTurnFloor_rad = 1e-5;  // no pose is given better
constexpr double kLargestOffset_px = 5;
constexpr double kKnownRelativeSigma = 0.1;  // of a corner's inverse depth that is carried over
constexpr double kEnoughScaleSigma = 0.08;
constexpr std::size_t kLeastStations = 12;  // that tell how good given places are
constexpr std::size_t kMostFrames = 1000;   // whose given poses the scale stands on

/// A frame, as it came and as it is adjusted.
struct View {
  Isometry3d given = Isometry3d::Identity();      ///< metres
  Matrix6d information = Matrix6d::Zero();        ///< of `given`
  Matrix3d shift_information = Matrix3d::Zero();  ///< of its translation alone
  AdjustedView adjusted;                          ///< gauge units
};

/// What the scale stands on: where a frame is in gauge units, and where it was said to be.
struct Station {
  Matrix3d R;
  Vector3d t, given;
  Matrix3d information;
};

}  // namespace

struct PoseRefinement::State {
  State(const CameraModel& c, const DepthFilterOptions& options, WorkerPool* p)
      : camera(c),
        pool(p),
        prior_mean(0.5 * (1 / options.min_depth_m + 1 / options.max_depth_m)),
        prior_sigma(options.inverse_range() / 3),
        adjustment(c, 0.5 / options.max_depth_m, 2 / options.min_depth_m),
        key_image(c.width, c.height),
        image(c.width, c.height) {
    corners_px.reserve(2 * kCorners);
    stations.reserve(kMostFrames);
  }

  Vector2d project(const Isometry3d& T, const AdjustedCorner& corner) const {
    const Vector3d P = T.linear() * corner.ray + corner.inverse * T.translation();
    return {camera.fx * P.x() / P.z() + camera.cx, camera.fy * P.y() / P.z() + camera.cy};
  }

  /// The given pose in gauge units: the key frame's error taken out, lengths divided by the scale.
  void set_prior(View* view) const {
    const double unit = gauge ? scale : 1;
    AdjustedView& adjusted = view->adjusted;
    adjusted.prior = view->given;
    adjusted.prior.translation() = (view->given.translation() - view->given.linear() * key_offset) / unit;
    adjusted.information = view->information;
    adjusted.information.topRows<3>() *= unit;
    adjusted.information.leftCols<3>() *= unit;
  }

  void find_places(View* view);
  void adjust(View* newest);
  void keep_gauge(const std::vector<AdjustedCorner>& before, View* newest);
  void follow_scale();
  void add_station(const View& view);
  void choose_gauge(View* newest);
  void keep_as_anchor(View&& view);

  CameraModel camera;
  WorkerPool* pool;
  double prior_mean, prior_sigma;  ///< of a corner's inverse depth that nothing is known of, 1/m
  WindowAdjustment adjustment;
  ImagePyramid key_image, image;

  std::vector<Eigen::Vector2f> corners_px;
  std::vector<AdjustedCorner> corners;
  std::vector<Vector2d> offsets;  ///< of the last place each was found at from where it was expected
  std::vector<View> anchors;
  std::vector<Station> stations;
  std::vector<double> ratios;
  Matrix3d key_shift_covariance = Matrix3d::Zero();

  bool gauge = false;  ///< chosen: lengths keep their unit from now on
  double scale = 1, scale_sigma = 0;
  double carried_sigma = 0;                ///< of the gauge's unit where it was carried over; 0: it was not
  Vector3d key_offset = Vector3d::Zero();  ///< error of the key frame's given place, metres along its axes
  double pixel_sigma = 0.5;                ///< that the adjustment weighs corners with
  double misfit_px = 0;
};

PoseRefinement::PoseRefinement(const CameraModel& camera, const DepthFilterOptions& options, WorkerPool* pool)
    : state_(std::make_unique<State>(camera, options, pool)) {}

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
  s.anchors.clear();
  s.stations.clear();
  s.key_shift_covariance = key_covariance.topLeftCorner<3, 3>() + 1e-12 * Matrix3d::Identity();
  s.gauge = 2 * known > s.corners.size();
  s.scale = 1;
  s.scale_sigma = s.carried_sigma = s.gauge ? scale_sigma : 0;
  s.key_offset.setZero();
  s.pixel_sigma = 0.5;
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

/// Poses and corners from all views kept and the newest. Until the gauge is chosen each frame also tries the poses as
/// given with corners that fit them: with little parallax a wrong scene, inside out, may fit nearly as well as the true
/// one, and one does not come from there to the other in small steps.
void PoseRefinement::State::adjust(View* newest) {
  std::vector<AdjustedView*> views;
  for (View& anchor : anchors) views.push_back(&anchor.adjusted);
  views.push_back(&newest->adjusted);
  for (View& anchor : anchors) set_prior(&anchor);
  set_prior(newest);
  const std::vector<AdjustedCorner> before = corners;
  double cost = adjustment.run(views, corners, pixel_sigma, gauge ? 5 : 10);
  if (gauge) keep_gauge(before, newest);
  if (!gauge) {
    std::vector<Isometry3d> poses;
    std::vector<AdjustedCorner> found = corners;
    for (AdjustedView* view : views) {
      poses.push_back(view->T);
      view->T = view->prior;
    }
    for (AdjustedCorner& corner : corners) corner.inverse = corner.prior_mean;
    adjustment.run_structure(views, corners, pixel_sigma, 4);
    if (adjustment.run(views, corners, pixel_sigma, 8) > cost) {
      for (std::size_t i = 0; i < views.size(); ++i) views[i]->T = poses[i];
      corners = found;
      adjustment.run(views, corners, pixel_sigma, 1);
    }
  }
  const double residual_sigma = adjustment.residual_sigma(views, corners);
  misfit_px = std::sqrt(std::max(0.0, residual_sigma * residual_sigma - 2 * kCornerSigma_px * kCornerSigma_px));
  const double found = static_cast<double>(std::count_if(newest->adjusted.places.begin(), newest->adjusted.places.end(),
                                                         [](const PatchPlace& place) { return place.found; }));
  pixel_sigma = std::hypot(kCornerSigma_px, misfit_px * std::sqrt(std::max(1.0, found / kIndependentCorners)));
}

/// Undoes what the adjustment changed of all corners' depths alike: the gauge is theirs.
void PoseRefinement::State::keep_gauge(const std::vector<AdjustedCorner>& before, View* newest) {
  ratios.clear();
  for (std::size_t k = 0; k < corners.size(); ++k) {
    if (newest->adjusted.places[k].found) ratios.push_back(corners[k].inverse / before[k].inverse);
  }
  if (ratios.empty()) return;
  const auto median = ratios.begin() + static_cast<std::ptrdiff_t>(ratios.size() / 2);
  std::nth_element(ratios.begin(), median, ratios.end());
  const double grown = *median;
  for (AdjustedCorner& corner : corners) corner.inverse /= grown;
  for (View& anchor : anchors) anchor.adjusted.T.translation() *= grown;
  newest->adjusted.T.translation() *= grown;
}

/// Least squares for the unit's length s and the key frame's error c: given_i = s t_i + R_i c. Done twice: the first
/// residuals tell how good the given places really are, against what was stated of them.
void PoseRefinement::State::follow_scale() {
  double noise = 1;  // variance over the stated one
  for (int pass = 0; pass < 2; ++pass) {
    Eigen::Matrix4d H = Eigen::Matrix4d::Zero();
    Eigen::Vector4d g = Eigen::Vector4d::Zero();
    H.bottomRightCorner<3, 3>() = key_shift_covariance.inverse() / noise;
    if (carried_sigma > 0) {
      H(0, 0) = 1 / (carried_sigma * carried_sigma);
      g(0) = H(0, 0);
    }
    Eigen::Matrix<double, 3, 4> A;
    for (const Station& station : stations) {
      A << station.t, station.R;
      H += A.transpose() * station.information * A / noise;
      g += A.transpose() * station.information * station.given / noise;
    }
    const Eigen::LDLT<Eigen::Matrix4d> solver(H);
    const Eigen::Vector4d solution = solver.solve(g);
    const double variance = solver.solve(Eigen::Vector4d::Unit(0))(0);
    if (!solution.allFinite() || !(variance > 0)) return;
    if (!(solution(0) > 0.2 && solution(0) < 5)) return;  // not to be believed yet
    scale = solution(0);
    key_offset = solution.tail<3>();
    scale_sigma = std::sqrt(variance);
    if (stations.size() < kLeastStations) return;
    double squares = 0;
    for (const Station& station : stations) {
      const Vector3d off = station.given - scale * station.t - station.R * key_offset;
      squares += off.dot(station.information * off);
    }
    noise = std::clamp(squares / (3 * static_cast<double>(stations.size()) - 4), 0.01, 100.0);
  }
}

void PoseRefinement::State::add_station(const View& view) {
  if (stations.size() == kMostFrames) return;
  const Isometry3d& T = view.adjusted.T;
  stations.push_back({T.linear(), T.translation(), view.given.translation(), view.shift_information});
}

/// From here on the unit of length stays: a metre, as well as it is known now.
void PoseRefinement::State::choose_gauge(View* newest) {
  for (View& anchor : anchors) anchor.adjusted.T.translation() *= scale;
  newest->adjusted.T.translation() *= scale;
  for (Station& station : stations) station.t *= scale;
  for (AdjustedCorner& corner : corners) {
    corner.inverse /= scale;
    corner.prior_mean /= scale;
    corner.prior_sigma /= scale;
  }
  scale_sigma /= scale;
  scale = 1;
  gauge = true;
}

/// Keeps the anchors apart: the one nearest to another one goes.
void PoseRefinement::State::keep_as_anchor(View&& view) {
  anchors.push_back(std::move(view));
  if (anchors.size() <= kAnchors) return;
  std::size_t least = 0;
  double least_distance = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < anchors.size(); ++i) {
    for (std::size_t k = 0; k < i; ++k) {
      const double distance = (anchors[i].adjusted.T.translation() - anchors[k].adjusted.T.translation()).norm();
      if (distance < least_distance) {
        least_distance = distance;
        least = i;
      }
    }
  }
  anchors.erase(anchors.begin() + static_cast<std::ptrdiff_t>(least));
}

RefinedPose PoseRefinement::refine(const GreyImage& image, const Isometry3d& T_frame_key,
                                   const Matrix6d& frame_covariance) {
  State& s = *state_;
  s.image.build(image);
  View view;
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
  s.adjust(&view);
  refined.covariance = s.adjustment.last_covariance();
  for (std::size_t k = 0; k < s.corners.size(); ++k) {
    if (!view.adjusted.places[k].found) continue;
    s.offsets[k] = view.adjusted.places[k].position.cast<double>() - s.project(view.adjusted.T, s.corners[k]);
    if (s.offsets[k].norm() > kLargestOffset_px) s.offsets[k].setZero();
  }
  if (s.gauge) {
    s.add_station(view);
    s.follow_scale();
  } else {
    // The whole window has been adjusted anew: earlier places are out of date.
    s.stations.clear();
    for (const View& anchor : s.anchors) s.add_station(anchor);
    s.add_station(view);
    s.follow_scale();
    if (s.scale_sigma < kEnoughScaleSigma * s.scale) s.choose_gauge(&view);
  }
  refined.T_frame_key = view.adjusted.T;
  refined.has_parallax = s.gauge;
  refined.misfit_px = s.misfit_px;
  s.keep_as_anchor(std::move(view));
  return refined;
}

double PoseRefinement::scale() const { return state_->gauge ? state_->scale : 1; }
double PoseRefinement::scale_sigma() const { return state_->gauge ? state_->scale_sigma : 0; }

}  // namespace vantage
