#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <thread>

#include "onboard/depth/depth_filter.h"

namespace vantage {

/// Runs a depth filter on a thread of its own. Frames that come while it is busy wait in a single place: a newer one
/// takes it, and the one that waited is counted as passed over.
///
/// The first frame begins a key frame; when one has done its duty `finished` is called with the filter, on the worker's
/// thread, and the next begins with the frame at hand.
class DepthWorker {
 public:
  using Finished = std::function<void(const DepthFilter&, const PosedImage& key_frame)>;

  DepthWorker(std::unique_ptr<DepthFilter> filter, Finished finished);

  /// Finishes the frame that it works on and ends.
  ~DepthWorker();

  /// Never waits. For one thread. `anew`: the world has moved against earlier frames' (a loop was closed); what the key
  /// frame at hand has learnt is given up, and this frame begins the next.
  void offer(PosedImage frame, bool anew = false);

  /// Waits until no frame is waiting or being worked on.
  void drain();

  std::uint64_t passed_over() const;
  std::uint64_t used() const;

 private:
  void run();

  std::unique_ptr<DepthFilter> filter_;
  Finished finished_;
  mutable std::mutex mutex_;  ///< guards what follows
  std::condition_variable offered_, idle_;
  std::optional<PosedImage> waiting_;
  bool anew_ = false;  ///< with the frame that waits, or one that it replaced
  bool busy_ = false;
  bool stop_ = false;
  std::uint64_t passed_over_ = 0, used_ = 0;
  std::thread thread_;
};

}  // namespace vantage
