#include "onboard/tracking/pose_graph.h"

#include <array>
#include <cmath>

#include <ceres/ceres.h>
#include <ceres/rotation.h>

namespace vantage::tracking {
namespace {

/// Difference between S_a S_b^-1 and what it should be: translation relative to the edge's length, rotation, log scale.
struct EdgeResidual {
  Similarity S_a_b;
  double weight;
  double length;

  template <typename T>
  bool operator()(const T* qa, const T* ta, const T* sa, const T* qb, const T* tb, const T* sb, T* residual) const {
    using Quaternion = Eigen::Quaternion<T>;
    using Vector = Eigen::Matrix<T, 3, 1>;
    const Eigen::Map<const Quaternion> ra(qa), rb(qb);
    const Eigen::Map<const Vector> xa(ta), xb(tb);
    // S_a S_b^-1: scale sa/sb, rotation ra rb^-1, translation xa - scale * rotation * xb. Scales are logarithms.
    const Quaternion rotation = ra * rb.conjugate();
    const T scale = exp(sa[0] - sb[0]);
    const Vector translation = xa - scale * (rotation * xb);
    const Quaternion error = S_a_b.rotation.conjugate().template cast<T>() * rotation;
    const T sign = error.w() < T(0) ? T(-1) : T(1);
    for (int k = 0; k < 3; ++k) {
      residual[k] = weight / length * (translation[k] - S_a_b.translation[k]);
      residual[3 + k] = weight * T(2) * sign * error.vec()[k];
    }
    residual[6] = weight * (sa[0] - sb[0] - std::log(S_a_b.scale));
    return true;
  }
};

}  // namespace

bool optimise(PoseGraph* graph, bool with_scale, int iterations) {
  struct Blocks {
    std::array<double, 4> rotation;
    std::array<double, 3> translation;
    double log_scale;
  };
  std::vector<Blocks> blocks;
  blocks.reserve(graph->nodes.size());
  double length = 0;
  for (const PoseGraphNode& node : graph->nodes) {
    const Similarity& s = node.S_camera_world;
    blocks.push_back({{s.rotation.x(), s.rotation.y(), s.rotation.z(), s.rotation.w()},
                      {s.translation.x(), s.translation.y(), s.translation.z()},
                      std::log(s.scale)});
  }
  for (const PoseGraphEdge& edge : graph->edges) length += edge.S_a_b.translation.norm();
  length = std::max(1e-9, length / static_cast<double>(std::max<std::size_t>(1, graph->edges.size())));

  ceres::Problem problem;
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    problem.AddParameterBlock(blocks[i].rotation.data(), 4, new ceres::EigenQuaternionManifold);
    problem.AddParameterBlock(blocks[i].translation.data(), 3);
    problem.AddParameterBlock(&blocks[i].log_scale, 1);
    if (graph->nodes[i].fixed) {
      problem.SetParameterBlockConstant(blocks[i].rotation.data());
      problem.SetParameterBlockConstant(blocks[i].translation.data());
    }
    if (graph->nodes[i].fixed || !with_scale) problem.SetParameterBlockConstant(&blocks[i].log_scale);
  }
  for (const PoseGraphEdge& edge : graph->edges) {
    Blocks& a = blocks[static_cast<std::size_t>(edge.a)];
    Blocks& b = blocks[static_cast<std::size_t>(edge.b)];
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<EdgeResidual, 7, 4, 3, 1, 4, 3, 1>(
                                 new EdgeResidual{edge.S_a_b, std::sqrt(edge.weight), length}),
                             nullptr, a.rotation.data(), a.translation.data(), &a.log_scale, b.rotation.data(),
                             b.translation.data(), &b.log_scale);
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  options.max_num_iterations = iterations;
  options.num_threads = 1;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  if (!summary.IsSolutionUsable()) return false;
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    const Blocks& block = blocks[i];
    graph->nodes[i].S_camera_world = {
        Eigen::Quaterniond(block.rotation[3], block.rotation[0], block.rotation[1], block.rotation[2]).normalized(),
        Eigen::Vector3d(block.translation[0], block.translation[1], block.translation[2]), std::exp(block.log_scale)};
  }
  return true;
}

}  // namespace vantage::tracking
