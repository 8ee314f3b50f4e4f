#pragma once

#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include <octomap/OcTree.h>

#include "offboard/gain/formulation.h"
#include "offboard/gain/ray_sums.h"
#include "offboard/mapping/octomap_io.h"
#include "tests/offboard/mapping/octomap_oracle.h"

namespace vantage {

/// One voxel of a ray as OctoMap tells it.
struct OctomapVoxel {
  const octomap::OcTreeNode* node;  // null: unobserved
  double proximity_m;               // d_max - d(x) of a marked voxel; negative: no mark
  bool occplane;                    // marked, and beside a free voxel
};

/// A formulation in the way of the paper's release: told of each voxel of each ray in turn, it works out what it needs
/// from the node by itself.
class OctomapFormulation {
 public:
  virtual ~OctomapFormulation() = default;
  virtual void begin_ray() {}
  virtual void visit(const OctomapVoxel& voxel) = 0;
  virtual void end_ray() {}
  double value = 0;

 protected:
  static double occupancy(const OctomapVoxel& voxel) {
    return voxel.node == nullptr ? 0.5 : voxel.node->getOccupancy();
  }
  static double entropy(double p) { return -p * std::log(p) - (1 - p) * std::log(1 - p); }
  static bool is_occupied(double p) { return p >= 0.8 - 1e-6; }
  static bool is_unknown(const OctomapVoxel& voxel) {
    const double p = occupancy(voxel);
    return voxel.node == nullptr || (p < 0.8 - 1e-6 && p > 0.2 + 1e-6);
  }
};

class OctomapEntropy : public OctomapFormulation {
  void visit(const OctomapVoxel& voxel) override { value += entropy(occupancy(voxel)); }
};

class OctomapOcclusionAware : public OctomapFormulation {
  void begin_ray() override { visibility_ = 1; }
  void visit(const OctomapVoxel& voxel) override {
    const double p = occupancy(voxel);
    value += visibility_ * entropy(p);
    visibility_ *= 1 - p;
  }
  double visibility_ = 1;
};

class OctomapUnobservedVoxel : public OctomapFormulation {
  void begin_ray() override { visibility_ = 1; }
  void visit(const OctomapVoxel& voxel) override {
    const double p = occupancy(voxel);
    if (is_unknown(voxel)) value += visibility_ * entropy(p);
    visibility_ *= 1 - p;
  }
  double visibility_ = 1;
};

class OctomapRearSideVoxel : public OctomapFormulation {
  void begin_ray() override { before_unknown_ = false; }
  void visit(const OctomapVoxel& voxel) override {
    if (before_unknown_ && is_occupied(occupancy(voxel))) value += 1;
    before_unknown_ = is_unknown(voxel);
  }
  bool before_unknown_ = false;
};

class OctomapRearSideEntropy : public OctomapFormulation {
  void begin_ray() override {
    visibility_ = 1;
    run_ = 0;
  }
  void visit(const OctomapVoxel& voxel) override {
    const double p = occupancy(voxel);
    if (is_unknown(voxel)) {
      run_ += visibility_ * entropy(p);
    } else {
      if (is_occupied(p)) value += run_;
      run_ = 0;
    }
    visibility_ *= 1 - p;
  }
  double visibility_ = 1, run_ = 0;
};

class OctomapProximityCount : public OctomapFormulation {
  void visit(const OctomapVoxel& voxel) override {
    if (voxel.proximity_m >= 0 && is_unknown(voxel)) value += voxel.proximity_m;
  }
};

class OctomapAverageEntropy : public OctomapFormulation {
  void visit(const OctomapVoxel& voxel) override {
    sum_ += entropy(occupancy(voxel));
    ++count_;
    value = sum_ / static_cast<double>(count_);
  }
  double sum_ = 0;
  std::int64_t count_ = 0;
};

class OctomapAreaFactor : public OctomapFormulation {
  void begin_ray() override { end_ = 0; }
  void visit(const OctomapVoxel& voxel) override {
    if (end_ != 0) return;
    if (is_occupied(occupancy(voxel))) end_ = 1;
    if (voxel.occplane) end_ = 2;
  }
  void end_ray() override {
    ++rays_;
    occupied_ += end_ == 1;
    occplane_ += end_ == 2;
    // Written out anew from Eqs. 19-21.
    value = f(occupied_ / rays_, 0.2) + f(occplane_ / rays_, 0.8);
  }
  static double f(double a, double d) {
    if (a <= d) return -2 / std::pow(d, 3) * std::pow(a, 3) + 3 / std::pow(d, 2) * std::pow(a, 2);
    const double c = std::pow(d - 1, 3);
    return -2 / c * std::pow(a, 3) + 3 * (d + 1) / c * std::pow(a, 2) - 6 * d / c * a + (3 * d - 1) / c;
  }
  int end_ = 0;
  double rays_ = 0, occupied_ = 0, occplane_ = 0;
};

/// Information gain by OctoMap's computeRayKeys: the oracle of the tests and the baseline of the benchmark.
class OctomapGain {
 public:
  explicit OctomapGain(const OccupancyMap& map) : region_(map.region()), tree_(to_octree(map)) {
    const Eigen::Vector3i size = region_.size_voxels;
    proximity_.assign(static_cast<std::size_t>(region_.voxel_count()), -1);
    occplane_.assign(proximity_.size(), 0);
    Eigen::Vector3i v;
    for (v.z() = 0; v.z() < size.z(); ++v.z()) {
      for (v.y() = 0; v.y() < size.y(); ++v.y()) {
        for (v.x() = 0; v.x() < size.x(); ++v.x()) {
          const double distance = map.occlusion_distance_m(v);
          if (!std::isfinite(distance)) continue;
          proximity_[index(v)] = map.sensor_model().occlusion_range_m - distance;
          bool beside_free = false;
          for (int side = 0; side < 6; ++side) {
            const Eigen::Vector3i n = v + (side % 2 == 0 ? 1 : -1) * Eigen::Vector3i::Unit(side / 2);
            const octomap::OcTreeNode* node = region_.contains(n) ? node_at(*tree_, region_, n) : nullptr;
            beside_free = beside_free || (node != nullptr && node->getOccupancy() <= 0.2 + 1e-6);
          }
          const octomap::OcTreeNode* node = node_at(*tree_, region_, v);
          const double p = node == nullptr ? 0.5 : node->getOccupancy();
          occplane_[index(v)] = beside_free && (node == nullptr || (p > 0.2 + 1e-6 && p < 0.8 - 1e-6));
        }
      }
    }
  }

  /// Values of all formulations but `combined` over rays from `origin` along `directions` (world).
  std::array<double, kFormulations> evaluate(const Eigen::Vector3d& origin,
                                             const std::vector<Eigen::Vector3d>& directions) {
    std::array<std::unique_ptr<OctomapFormulation>, kFormulations> all;
    const auto put = [&](Formulation f, std::unique_ptr<OctomapFormulation> object) {
      all[static_cast<std::size_t>(f)] = std::move(object);
    };
    put(Formulation::kEntropy, std::make_unique<OctomapEntropy>());
    put(Formulation::kOcclusionAware, std::make_unique<OctomapOcclusionAware>());
    put(Formulation::kUnobservedVoxel, std::make_unique<OctomapUnobservedVoxel>());
    put(Formulation::kRearSideVoxel, std::make_unique<OctomapRearSideVoxel>());
    put(Formulation::kRearSideEntropy, std::make_unique<OctomapRearSideEntropy>());
    put(Formulation::kProximityCount, std::make_unique<OctomapProximityCount>());
    put(Formulation::kAverageEntropy, std::make_unique<OctomapAverageEntropy>());
    put(Formulation::kAreaFactor, std::make_unique<OctomapAreaFactor>());
    for (const Eigen::Vector3d& direction : directions) {
      for (const auto& formulation : all) {
        if (formulation != nullptr) formulation->begin_ray();
      }
      cast(origin, direction, [&](const OctomapVoxel& voxel) {
        ++visits_;
        for (const auto& formulation : all) {
          if (formulation != nullptr) formulation->visit(voxel);
        }
      });
      for (const auto& formulation : all) {
        if (formulation != nullptr) formulation->end_ray();
      }
    }
    std::array<double, kFormulations> values{};
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = all[i] == nullptr ? 0 : all[i]->value;
    return values;
  }

  std::int64_t visits() const { return visits_; }

 private:
  std::size_t index(const Eigen::Vector3i& v) const {
    const Eigen::Vector3i size = region_.size_voxels;
    return static_cast<std::size_t>(v.x()) +
           static_cast<std::size_t>(size.x()) *
               (static_cast<std::size_t>(v.y()) + static_cast<std::size_t>(size.y()) * static_cast<std::size_t>(v.z()));
  }

  /// Calls visit for the voxels of the ray inside the region, up to the first occupied one.
  template <typename Visit>
  void cast(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, Visit&& visit) {
    double length = 0;  // to beyond the region's farthest corner
    for (int corner = 0; corner < 8; ++corner) {
      const Eigen::Vector3d size = region_.resolution_m * region_.size_voxels.cast<double>();
      const Eigen::Vector3d at =
          region_.min_corner +
          Eigen::Vector3d((corner & 1) * size.x(), (corner >> 1 & 1) * size.y(), (corner >> 2) * size.z());
      length = std::max(length, (at - origin).norm());
    }
    tree_->computeRayKeys(to_point3d(origin), to_point3d(origin + (length + 2 * region_.resolution_m) * direction),
                          keys_);
    const Eigen::Vector3i first = (region_.min_corner / region_.resolution_m).array().round().cast<int>().matrix() +
                                  Eigen::Vector3i::Constant(32768);
    for (const octomap::OcTreeKey& key : keys_) {
      const Eigen::Vector3i voxel = Eigen::Vector3i(key[0], key[1], key[2]) - first;
      if (!region_.contains(voxel)) continue;
      const octomap::OcTreeNode* node = tree_->search(key);
      const std::size_t i = index(voxel);
      visit(OctomapVoxel{node, proximity_[i], occplane_[i] != 0});
      if (node != nullptr && node->getOccupancy() >= 0.8 - 1e-6) return;
    }
  }

  Region region_;
  std::unique_ptr<octomap::OcTree> tree_;
  std::vector<double> proximity_;
  std::vector<char> occplane_;
  octomap::KeyRay keys_;
  std::int64_t visits_ = 0;
};

}  // namespace vantage
