#include "onboard/tracking/similarity.h"

namespace vantage::tracking {

Similarity fit_similarity(std::span<const Eigen::Vector3d> from, std::span<const Eigen::Vector3d> to, bool with_scale) {
  Eigen::Matrix3Xd a(3, static_cast<Eigen::Index>(from.size())), b(3, static_cast<Eigen::Index>(to.size()));
  for (std::size_t i = 0; i < from.size(); ++i) {
    a.col(static_cast<Eigen::Index>(i)) = from[i];
    b.col(static_cast<Eigen::Index>(i)) = to[i];
  }
  const Eigen::Matrix4d m = Eigen::umeyama(a, b, with_scale);
  Similarity result;
  result.scale = with_scale ? m.topLeftCorner<3, 1>().norm() : 1;
  result.rotation = Eigen::Quaterniond(Eigen::Matrix3d(m.topLeftCorner<3, 3>() / result.scale)).normalized();
  result.translation = m.topRightCorner<3, 1>();
  return result;
}

}  // namespace vantage::tracking
