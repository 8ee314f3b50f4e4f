#include "onboard/tracking/two_view_start.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <Eigen/SVD>
#include <opencv2/calib3d.hpp>

#include "onboard/tracking/bundle_adjustment.h"
#include "onboard/tracking/patch_alignment.h"
#include "onboard/tracking/pose_refinement.h"

namespace vantage::tracking {
namespace {

constexpr double kFollowedCorrelation = 0.8;
constexpr std::size_t kMostBetween = 60;  // frames whose tracks are kept; thinned out when there are more

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Point seen along two rays, in the first camera's frame: the middle of the shortest line between them.
bool triangulate(const Eigen::Isometry3d& T_last_first, const Eigen::Vector3d& ray_first,
                 const Eigen::Vector3d& ray_last, Eigen::Vector3d* position) {
  const Eigen::Isometry3d T_first_last = T_last_first.inverse();
  const Eigen::Vector3d other = T_first_last.linear() * ray_last, t = T_first_last.translation();
  const double c = ray_first.dot(other), d = 1 - c * c;
  if (d < 1e-10) return false;
  const double s = (ray_first.dot(t) - c * other.dot(t)) / d, r = (c * ray_first.dot(t) - other.dot(t)) / d;
  if (!(s > 0) || !(r > 0)) return false;
  *position = 0.5 * (s * ray_first + t + r * other);
  return true;
}

constexpr double kOutlierCost = 6;       // residuals' variances: about the square of where an inlier ends
constexpr double kAmbiguous = 3;         // times the best cost: a motion this good may be the true one
constexpr double kSameDirection = 0.87;  // cosine of 30 degrees between two ways that count as the same

/// Median angle between two sets of rays after the turn that brings the one onto the other (Huber's weights; the rows
/// of the correlation's SVD: Kabsch 1976).
double angle_left_by_turn(const std::vector<Eigen::Vector3d>& from, const std::vector<Eigen::Vector3d>& to) {
  std::vector<double> angles(from.size(), 0);
  double scale = 1;
  for (int round = 0; round < 5; ++round) {
    Eigen::Matrix3d correlation = Eigen::Matrix3d::Zero();
    for (std::size_t i = 0; i < from.size(); ++i) {
      correlation += (angles[i] > scale ? scale / angles[i] : 1) * to[i] * from[i].transpose();
    }
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(correlation, Eigen::ComputeFullU | Eigen::ComputeFullV);
    Eigen::Vector3d signs(1, 1, (svd.matrixU() * svd.matrixV().transpose()).determinant());
    const Eigen::Matrix3d R = svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
    for (std::size_t i = 0; i < from.size(); ++i) angles[i] = (R * from[i]).cross(to[i]).norm();
    scale = std::max(1e-6, median(angles));
  }
  return scale;
}

struct Candidate {
  Eigen::Isometry3d T_last_first;
  int explained = 0;
  double cost = 0;
};

}  // namespace

bool StartOptions::valid(std::string* why) const {
  const auto fail = [why](const char* reason) {
    if (why != nullptr) *why = reason;
    return false;
  };
  if (!(least_disparity_px > 0)) return fail("least_disparity_px must be positive");
  if (!(least_parallax_px > 0) || !(least_turned_px >= 0)) return fail("least_..._px must be positive");
  if (least_points < 12) return fail("least_points must be at least 12");
  if (!(error_px > 0)) return fail("error_px must be positive");
  if (!(least_share > 0 && least_share <= 1)) return fail("least_share must lie in (0, 1]");
  if (frames_between < 0) return fail("frames_between must not be negative");
  return true;
}

TwoViewStart::TwoViewStart(const CameraModel& camera, const StartOptions& options)
    : camera_(camera), options_(options), rotation_(camera) {}

void TwoViewStart::reset() {
  first_.reset();
  tracks_.clear();
  between_.clear();
  disparity_px_ = 0;
}

void TwoViewStart::begin(const StartFrame& frame) {
  reset();
  DetectorOptions detector;
  detector.edgelets = false;  // an edgelet's place along its edge says nothing of the motion
  detector.cell_px = 20;
  detector.fast_threshold = 12;
  detector.min_score = 30;
  std::vector<Corner> corners = detect_corners(*frame.image, {}, detector);
  if (corners.size() < static_cast<std::size_t>(options_.least_points)) return;
  first_ = frame;
  previous_ = frame.image;
  for (const Corner& corner : corners) tracks_.push_back({corner, corner.pixel, false});
  initial_tracks_ = tracks_.size();
}

bool TwoViewStart::follow(const ImagePyramid& image, Track* track, const Eigen::Vector2d& expected) const {
  Eigen::Vector2d pixel = expected;
  for (int level = 3; level >= track->corner.level; --level) {
    BorderedPatch patch;
    const Eigen::Vector2d from(to_level(track->corner.pixel.x(), level), to_level(track->corner.pixel.y(), level));
    if (!cut_patch(first_->image->level(level), from, &patch)) continue;
    const Eigen::Vector2d start(to_level(pixel.x(), level), to_level(pixel.y(), level));
    const PatchAlignment found = align_patch(image.level(level), patch, start, nullptr, 20);
    const bool finest = level == track->corner.level;
    if (finest && (!found.converged || found.correlation < kFollowedCorrelation)) return false;
    if (found.converged && found.correlation > (finest ? kFollowedCorrelation : 0.6)) {
      pixel = {to_base(found.pixel.x(), level), to_base(found.pixel.y(), level)};
    }
  }
  track->pixel = pixel;
  return image.level(0).inside(pixel.x(), pixel.y(), 4);
}

std::optional<Start> TwoViewStart::add(const StartFrame& frame) {
  if (!first_) {
    begin(frame);
    return std::nullopt;
  }
  const RotationAlignment::Result turn = rotation_.align(*previous_, *frame.image);
  previous_ = frame.image;
  std::vector<double> disparities;
  Between between;
  std::size_t alive = 0;
  for (Track& track : tracks_) {
    Eigen::Vector2d expected = track.pixel;
    Eigen::Vector3d ray;
    if (turn.correlation > 0.8 && camera_.unproject(track.pixel, &ray)) {
      camera_.project(turn.R_current_reference * ray, &expected);
    }
    if (!track.lost) {
      Track trial = track;
      if (follow(*frame.image, &trial, expected) || follow(*frame.image, &trial, track.pixel)) {
        track = trial;
      } else {
        track.lost = true;
      }
    }
    if (!track.lost) {
      ++alive;
      disparities.push_back((track.pixel - track.corner.pixel).norm());
    }
    between.pixels.push_back(track.lost ? Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN())
                                        : track.pixel);
  }
  if (alive < static_cast<std::size_t>(options_.least_points) || 3 * alive < initial_tracks_) {
    begin(frame);
    return std::nullopt;
  }
  disparity_px_ = median(disparities);
  std::optional<Start> start;
  if (disparity_px_ >= options_.least_disparity_px) start = solve(frame);
  between_.push_back(std::move(between));
  if (between_.size() > kMostBetween) {  // every second
    for (std::size_t i = 0; 2 * i < between_.size(); ++i) between_[i] = between_[2 * i];
    between_.resize((between_.size() + 1) / 2);
  }
  return start;
}

std::optional<Start> TwoViewStart::solve(const StartFrame& frame) const {
  struct Pair {
    std::size_t track;
    Eigen::Vector3d first, last;
  };
  std::vector<Pair> pairs;
  std::vector<cv::Point2d> a, b;
  for (std::size_t i = 0; i < tracks_.size(); ++i) {
    if (tracks_[i].lost) continue;
    Pair pair{i, {}, {}};
    if (!camera_.unproject(tracks_[i].corner.pixel, &pair.first) || !camera_.unproject(tracks_[i].pixel, &pair.last) ||
        pair.first.z() < 0.1 || pair.last.z() < 0.1) {
      continue;
    }
    pairs.push_back(pair);
    a.emplace_back(pair.first.x() / pair.first.z(), pair.first.y() / pair.first.z());
    b.emplace_back(pair.last.x() / pair.last.z(), pair.last.y() / pair.last.z());
  }
  const auto least = static_cast<std::size_t>(options_.least_points);
  if (pairs.size() < least) return std::nullopt;
  std::vector<Eigen::Vector3d> rays_first, rays_last;
  for (const Pair& pair : pairs) {
    rays_first.push_back(pair.first);
    rays_last.push_back(pair.last);
  }
  if (camera_.fx * angle_left_by_turn(rays_first, rays_last) < options_.least_turned_px) return std::nullopt;

  std::vector<Candidate> candidates;
  const auto propose = [&](const Eigen::Matrix3d& R, const Eigen::Vector3d& t) {
    Candidate candidate{};
    candidate.T_last_first = Eigen::Isometry3d::Identity();
    candidate.T_last_first.linear() = Eigen::Quaterniond(R).normalized().toRotationMatrix();
    candidate.T_last_first.translation() = t.normalized();
    candidates.push_back(candidate);
  };
  const auto to_eigen = [](const cv::Mat& m) {
    Eigen::Matrix3d e;
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) e(r, c) = m.at<double>(r, c);
    }
    return e;
  };
  const double threshold = options_.error_px / camera_.fx;
  const cv::Mat E = cv::findEssentialMat(a, b, 1.0, {0, 0}, cv::RANSAC, 0.999, threshold);
  for (int row = 0; row + 3 <= E.rows; row += 3) {
    Eigen::JacobiSVD<Eigen::Matrix3d> svd(to_eigen(E.rowRange(row, row + 3)),
                                          Eigen::ComputeFullU | Eigen::ComputeFullV);
    Eigen::Matrix3d U = svd.matrixU(), V = svd.matrixV(), W;
    if (U.determinant() < 0) U.col(2) *= -1;
    if (V.determinant() < 0) V.col(2) *= -1;
    W << 0, -1, 0, 1, 0, 0, 0, 0, 1;
    for (const Eigen::Matrix3d& R :
         {Eigen::Matrix3d(U * W * V.transpose()), Eigen::Matrix3d(U * W.transpose() * V.transpose())}) {
      propose(R, U.col(2));
      propose(R, -U.col(2));
    }
  }
  const cv::Mat H = cv::findHomography(a, b, cv::RANSAC, 1.5 * threshold);
  if (!H.empty()) {
    std::vector<cv::Mat> rotations, translations, normals;
    cv::decomposeHomographyMat(H, cv::Mat::eye(3, 3, CV_64F), rotations, translations, normals);
    for (std::size_t i = 0; i < rotations.size(); ++i) {
      const Eigen::Vector3d t(translations[i].at<double>(0), translations[i].at<double>(1),
                              translations[i].at<double>(2));
      if (t.norm() > 1e-4) propose(to_eigen(rotations[i]), t);
    }
  }

  const auto explain = [&](const Eigen::Isometry3d& T, std::vector<Eigen::Vector3d>* positions) {
    int explained = 0;
    if (positions) positions->assign(pairs.size(), Eigen::Vector3d::Zero());
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      Eigen::Vector3d position;
      Eigen::Vector2d in_first, in_last;
      if (!triangulate(T, pairs[i].first, pairs[i].last, &position) || !camera_.project(position, &in_first) ||
          !camera_.project(T * position, &in_last)) {
        continue;
      }
      const Track& track = tracks_[pairs[i].track];
      if ((in_first - track.corner.pixel).norm() > options_.error_px ||
          (in_last - track.pixel).norm() > options_.error_px) {
        continue;
      }
      ++explained;
      if (positions) (*positions)[i] = position;
    }
    return explained;
  };
  int most = 0;
  for (Candidate& candidate : candidates) {
    candidate.explained = explain(candidate.T_last_first, nullptr);
    most = std::max(most, candidate.explained);
  }
  if (most < options_.least_points || most < options_.least_share * static_cast<double>(pairs.size())) {
    return std::nullopt;
  }
  std::erase_if(candidates, [&](const Candidate& c) { return c.explained < 0.75 * most; });
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const Candidate& x, const Candidate& y) { return x.explained > y.explained; });
  if (candidates.size() > 4) candidates.resize(4);

  // Every candidate is adjusted over the frames between; the cost that stays decides.
  struct Outcome {
    Eigen::Isometry3d T_last_first;
    double cost;
  };
  std::vector<Outcome> outcomes;
  std::optional<Start> best;
  double best_cost = std::numeric_limits<double>::infinity();
  for (const Candidate& candidate : candidates) {
    std::vector<Eigen::Vector3d> positions;
    explain(candidate.T_last_first, &positions);
    AdjustmentProblem problem;
    problem.poses.push_back({Eigen::Isometry3d::Identity(), true, std::nullopt});
    problem.poses.push_back({candidate.T_last_first, false, std::nullopt});
    problem.kept_distance = {0, 1};
    std::vector<std::size_t> members;
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      if (positions[i].isZero()) continue;
      const Track& track = tracks_[pairs[i].track];
      const int point = static_cast<int>(problem.points.size());
      const double sigma = 1 << track.corner.level;
      problem.points.push_back(positions[i]);
      members.push_back(i);
      problem.observations.push_back({.pose = 0, .point = point, .pixel = track.corner.pixel, .sigma_px = sigma});
      problem.observations.push_back({.pose = 1, .point = point, .pixel = track.pixel, .sigma_px = sigma});
    }
    const int middle = std::min(options_.frames_between, static_cast<int>(between_.size()));
    for (int k = 0; k < middle; ++k) {
      const Between& frame_between =
          between_[static_cast<std::size_t>(k) * between_.size() / static_cast<std::size_t>(middle)];
      std::vector<PoseMeasurement> measurements;
      for (std::size_t m = 0; m < members.size(); ++m) {
        const Eigen::Vector2d& pixel = frame_between.pixels[pairs[members[m]].track];
        if (!pixel.allFinite()) continue;
        measurements.push_back({.position = problem.points[m],
                                .spread = Eigen::Vector3d::Zero(),
                                .pixel = pixel,
                                .sigma_px = static_cast<double>(1 << tracks_[pairs[members[m]].track].corner.level)});
      }
      if (measurements.size() < 12) continue;
      Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
      const double share = (k + 0.5) / middle;
      T.translation() = share * candidate.T_last_first.translation();
      T.linear() = Eigen::Quaterniond::Identity()
                       .slerp(share, Eigen::Quaterniond(candidate.T_last_first.linear()))
                       .toRotationMatrix();
      refine_pose(camera_, measurements, std::nullopt, &T, 10);
      const int pose = static_cast<int>(problem.poses.size());
      problem.poses.push_back({T, false, std::nullopt});
      for (std::size_t m = 0; m < members.size(); ++m) {
        const Eigen::Vector2d& pixel = frame_between.pixels[pairs[members[m]].track];
        if (!pixel.allFinite()) continue;
        problem.observations.push_back(
            {.pose = pose,
             .point = static_cast<int>(m),
             .pixel = pixel,
             .sigma_px = static_cast<double>(1 << tracks_[pairs[members[m]].track].corner.level)});
      }
    }
    const AdjustmentSummary summary = adjust(camera_, &problem, {.iterations = 20, .huber = 1.5, .seconds = 0});
    if (!summary.usable) continue;
    // Robust cost of all tracks: those that this candidate left out count as outliers.
    std::vector<int> good(problem.points.size(), 0), seen(problem.points.size(), 0);
    for (const AdjustedObservation& o : problem.observations) {
      ++seen[static_cast<std::size_t>(o.point)];
      good[static_cast<std::size_t>(o.point)] += o.inlier;
    }
    Start start;
    start.first = *first_;
    start.last = frame;
    start.T_last_first = problem.poses[1].T_camera_world;
    start.rms_px = summary.rms;
    std::vector<double> parallax;
    const Eigen::Vector3d centre = start.T_last_first.inverse().translation();
    for (std::size_t m = 0; m < problem.points.size(); ++m) {
      if (good[m] < 2 || 5 * good[m] < 4 * seen[m]) continue;
      const Eigen::Vector3d& position = problem.points[m];
      const Track& track = tracks_[pairs[members[m]].track];
      start.points.push_back({track.corner, track.pixel, position});
      parallax.push_back(std::acos(std::clamp(position.normalized().dot((position - centre).normalized()), -1.0, 1.0)));
    }
    start.parallax_rad = median(parallax);
    // All tracks count: those that the adjusted motion still leaves unexplained cost as much as an outlier.
    const double left_out = static_cast<double>(pairs.size()) - explain(start.T_last_first, nullptr);
    const double cost = summary.rms * summary.rms * static_cast<double>(start.points.size()) + kOutlierCost * left_out;
    outcomes.push_back({start.T_last_first, cost});
    if (cost >= best_cost) continue;
    best_cost = cost;
    best = std::move(start);
  }
  // Another motion that explains the tracks about as well: there is too little parallax to tell.
  for (const Outcome& outcome : outcomes) {
    if (outcome.cost > kAmbiguous * best_cost) continue;
    const Eigen::Isometry3d& T = best->T_last_first;
    const double cosine =
        (T.inverse().translation().normalized()).dot(outcome.T_last_first.inverse().translation().normalized());
    if (cosine < kSameDirection) return std::nullopt;
  }
  if (!best || best->points.size() < least ||
      static_cast<double>(best->points.size()) < options_.least_share * static_cast<double>(pairs.size()) ||
      best->parallax_rad * camera_.fx < options_.least_parallax_px || best->rms_px > 1.2) {
    return std::nullopt;
  }
  return best;
}

}  // namespace vantage::tracking
