#pragma once

#include <memory>
#include <string>

#include "drivers/camera/frame_source.h"
#include "lcmtypes/link/depth_map.h"
#include "onboard/depth/worker_pool.h"

namespace vantage {

struct SmoothingOptions {
  double huber_epsilon = 0.01;  ///< of the inverse depth's gradient over the image's mean inverse depth: below it the
                                ///< penalty is quadratic, so that slopes are not made into steps
  double strength = 0.03;       ///< weight of the gradient against the data
  double edge_alpha = 8;        ///< how fast the weight falls where the image has an edge: exp(-alpha |grad I|^beta)
  double edge_beta = 0.8;       ///< with grey levels from 0 to 1
  double least_data = 0.02;     ///< weight of the data where a pixel has not converged, of the surest pixel's 1
  double sure_sigma =
      0.004;  ///< over the depth: so sure a pixel has the surest pixel's weight, however sure others are
  int iterations = 60;

  bool valid(std::string* why = nullptr) const;
};

/// Smooths a depth map's converged pixels by weighted Huber-TV over inverse depth:
///
///     min over u   sum  g |grad u|_eps  +  sum  w / 2 (u - f)^2
///
/// f the inverse depths, g small at the image's edges, w the data's weight: the surest pixels keep their value, pixels
/// that have not converged follow their neighbours. Solved by the primal-dual algorithm (Chambolle and Pock, "A
/// first-order primal-dual algorithm for convex problems", 2011, Alg. 1). Depth of pixels that are not converged is
/// left as it was.
///
/// Made for one image size; allocates when it is made. Not for two threads at once.
class HuberTvSmoother {
 public:
  /// \pre options valid. `pool` must outlive it.
  HuberTvSmoother(int width, int height, const SmoothingOptions& options, WorkerPool* pool);
  ~HuberTvSmoother();

  /// Smooths `map` in place. \pre map and image have the size given. Does nothing when no pixel has converged.
  void smooth(const GreyImage& key_image, DepthMap* map);

  /// The energy above of the last solution, per pixel: for tests of convergence.
  double energy() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace vantage
