#include "offboard/lookahead/view_tour.h"

#include <algorithm>
#include <limits>
#include <utility>

namespace vantage {
namespace {

struct Tour {
  std::vector<std::size_t> views;
  double worth = 0, way_m = 0;
  std::vector<double> gains;  // of each view after these, or after a part of them: no less, for it is submodular

  bool operator<(const Tour& other) const {  // the better comes first
    return worth != other.worth ? worth > other.worth : views < other.views;
  }
};

}  // namespace

std::vector<std::size_t> best_tour(const Eigen::Vector3d& from, std::span<const Eigen::Vector3d> positions,
                                   double reference, const ViewTourOptions& options, SetCover* cover) {
  constexpr double kRounding = 1e-5;  // of gains, which are sums of floats
  std::vector<Tour> tours(1);
  tours.front().gains.assign(positions.size(), std::numeric_limits<double>::infinity());
  double discount = 1;
  for (std::size_t length = 0; length < std::min(options.length, positions.size()); ++length) {
    const std::size_t most = length == 0 ? positions.size() : options.kept;
    std::vector<Tour> longer;
    for (Tour& tour : tours) {
      cover->clear();
      for (const std::size_t view : tour.views) cover->take(view);
      const Eigen::Vector3d& at = tour.views.empty() ? from : positions[tour.views.back()];
      struct Added {
        std::size_t view;
        double worth, way_m;  // of the tour with it
      };
      std::vector<Added> added;
      bool at_its_end = true;
      for (std::size_t view = 0; view < positions.size(); ++view) {
        if (std::find(tour.views.begin(), tour.views.end(), view) != tour.views.end()) continue;
        const double leg_m = (positions[view] - at).norm();
        if (tour.way_m + leg_m > options.most_way_m) continue;
        at_its_end = false;
        const double price = options.way_weight_per_m * leg_m;
        const auto worth_with = [&](double gain) { return tour.worth + discount * (gain / reference - price); };
        if (longer.size() == most && worth_with(tour.gains[view]) + kRounding < longer.back().worth) continue;
        tour.gains[view] = cover->gain(view);
        added.push_back({view, worth_with(tour.gains[view]), tour.way_m + leg_m});
      }
      for (const Added& one : added) {
        Tour& next = longer.emplace_back(tour.views, one.worth, one.way_m, tour.gains);
        next.views.push_back(one.view);
      }
      if (at_its_end) longer.push_back(std::move(tour));
      std::sort(longer.begin(), longer.end());
      if (longer.size() > most) longer.resize(most);
    }
    tours = std::move(longer);
    discount *= options.discount;
  }
  cover->clear();
  return tours.front().views;
}

}  // namespace vantage
