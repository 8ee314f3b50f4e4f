#include "onboard/tracking/map_search.h"

#include <algorithm>
#include <numeric>
#include <random>

namespace vantage::tracking {
namespace {

constexpr int kTrialsPerCell = 4;

/// Displacement of the position (world) by one standard deviation of its distance from the host.
Eigen::Vector3d spread_of(const Map& map, const Landmark& landmark) {
  const KeyFrame* host = map.key_frame(landmark.host);
  return (landmark.position - host->T_camera_world.inverse().translation()).normalized() * landmark.sigma_m;
}

}  // namespace

bool MapSearchOptions::valid(std::string* why) const {
  const auto fail = [why](const char* reason) {
    if (why != nullptr) *why = reason;
    return false;
  };
  if (cells_across < 4) return fail("cells_across must be at least 4");
  if (most_matches < 12) return fail("most_matches must be at least 12");
  if (!(seed_spread_px >= 0)) return fail("seed_spread_px must not be negative");
  return true;
}

MapSearch::MapSearch(const CameraModel& camera, const MapSearchOptions& options) : camera_(camera), options_(options) {
  cell_px_ = std::max(8, (camera.width + options.cells_across - 1) / options.cells_across);
  columns_ = (camera.width + cell_px_ - 1) / cell_px_;
  rows_ = (camera.height + cell_px_ - 1) / cell_px_;
  cells_.resize(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_));
  order_.resize(cells_.size());
  std::iota(order_.begin(), order_.end(), std::size_t{0});
  std::mt19937 random(1);
  for (std::size_t i = order_.size(); i > 1; --i) std::swap(order_[i - 1], order_[random() % i]);
}

void MapSearch::run(Map* map, const std::vector<KeyFrameId>& key_frames, const ImagePyramid& current,
                    const Eigen::Isometry3d& T_current_world, MapMatches* matches, bool note) {
  matches->features.clear();
  matches->measurements.clear();
  matches->visible = matches->found = 0;
  for (auto& cell : cells_) cell.clear();
  const std::uint64_t visit = map->next_visit();
  const auto consider = [&](LandmarkId id) {
    Landmark* landmark = map->landmark(id);
    if (landmark == nullptr || landmark->last_visit == visit) return;
    landmark->last_visit = visit;
    Eigen::Vector2d pixel;
    Eigen::Matrix<double, 2, 3> projection;
    if (!camera_.project(T_current_world * landmark->position, &pixel, &projection) ||
        !current.level(0).inside(pixel.x(), pixel.y(), kPatch)) {
      return;
    }
    double rank = 0;
    if (landmark->converged) {
      rank = 10 + static_cast<double>(landmark->found + 1) / (landmark->tried + 2) +
             0.1 * static_cast<double>(std::min<std::size_t>(landmark->observations.size(), 10));
    } else {
      if (landmark->depth.inlier_ratio() < 0.45) return;
      const Eigen::Vector2d spread = projection * (T_current_world.linear() * spread_of(*map, *landmark));
      const double length = spread.norm();
      if (!(length < options_.widest_spread_px)) return;
      rank = length < options_.seed_spread_px ? 1 / (1 + length) : -length;
    }
    const int column = static_cast<int>(pixel.x()) / cell_px_, row = static_cast<int>(pixel.y()) / cell_px_;
    cells_[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(column)]
        .push_back({landmark, rank});
  };
  for (const KeyFrameId id : key_frames) {
    const KeyFrame* frame = map->key_frame(id);
    if (frame == nullptr) continue;
    for (const Feature& feature : frame->features) consider(feature.landmark);
    for (const LandmarkId hosted : frame->hosted) consider(hosted);
  }
  for (const std::size_t index : order_) {
    auto& cell = cells_[index];
    if (cell.empty()) continue;
    if (std::any_of(cell.begin(), cell.end(), [](const Candidate& c) { return c.rank >= 0; })) ++matches->visible;
    if (static_cast<int>(matches->features.size()) >= options_.most_matches) continue;
    const auto best_first = [](const Candidate& a, const Candidate& b) {
      return a.rank != b.rank ? a.rank > b.rank : a.landmark->id < b.landmark->id;
    };
    std::sort(cell.begin(), cell.end(), best_first);
    int trials = 0;
    for (const Candidate& candidate : cell) {
      if (candidate.rank < 0 || ++trials > kTrialsPerCell) break;
      Landmark& landmark = *candidate.landmark;
      Feature feature;
      const bool found = find_landmark(camera_, *map, landmark, current, T_current_world, &feature);
      if (note) {
        ++landmark.tried;
        landmark.found += found;
        landmark.missed_in_row = found ? 0 : landmark.missed_in_row + 1;
      }
      if (!found) continue;
      matches->found += landmark.converged;
      add(*map, landmark, feature, matches);
      cell.clear();
      break;
    }
  }
  for (const std::size_t index : order_) {
    if (static_cast<int>(matches->features.size()) >= options_.enough_matches) break;
    const auto& cell = cells_[index];  // best first; empty where one was found
    for (const Candidate& candidate : cell) {
      if (candidate.rank >= 0) continue;
      const Landmark& seed = *candidate.landmark;
      Feature feature;
      if (find_seed(camera_, *map->key_frame(seed.host), current, T_current_world, seed, &feature) ==
          SeedUpdate::kUpdated) {
        add(*map, seed, feature, matches);
        ++matches->visible;
      }
      break;  // the least uncertain one alone
    }
  }
}

void MapSearch::add(const Map& map, const Landmark& landmark, const Feature& feature, MapMatches* matches) const {
  matches->features.push_back(feature);
  matches->measurements.push_back({.position = landmark.position,
                                   .spread = spread_of(map, landmark),
                                   .pixel = feature.pixel,
                                   .sigma_px = static_cast<double>(1 << feature.level),
                                   .edgelet = feature.edgelet,
                                   .normal = feature.normal});
}

}  // namespace vantage::tracking
