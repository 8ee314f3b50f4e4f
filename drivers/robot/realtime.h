#pragma once

#include <string>

namespace vantage {

/// What the calling thread has got of real-time scheduling.
struct RealtimeState {
  bool fifo = false;  ///< SCHED_FIFO, read back from the kernel
  int priority = 0;
  bool memory_locked = false;  ///< no page of the process can be swapped out
  std::string missing;         ///< what is not as it should be, and the mend; empty: nothing
};

/// Puts the calling thread on SCHED_FIFO at `priority` and locks the process's memory, as far as the system allows, and
/// reads back what it has got.
RealtimeState enter_realtime(int priority);

}  // namespace vantage
