#include "drivers/robot/realtime.h"

#include <cerrno>
#include <cstring>

#include <sched.h>
#include <sys/mman.h>
#include <unistd.h>

namespace vantage {

RealtimeState enter_realtime(int priority) {
  RealtimeState state;
  const auto lacks = [&state](const std::string& what) { state.missing += (state.missing.empty() ? "" : "; ") + what; };
  sched_param wanted{};
  wanted.sched_priority = priority;
  // Of this thread alone; on Linux pid 0 is the calling thread.
  if (::sched_setscheduler(0, SCHED_FIFO | SCHED_RESET_ON_FORK, &wanted) != 0) {
    lacks("no SCHED_FIFO (" + std::string(std::strerror(errno)) +
          "): give the program CAP_SYS_NICE, or LimitRTPRIO=" + std::to_string(priority) + " in its service");
  }
  sched_param got{};
  state.fifo = (::sched_getscheduler(0) & ~SCHED_RESET_ON_FORK) == SCHED_FIFO && ::sched_getparam(0, &got) == 0 &&
               got.sched_priority == priority;
  state.priority = got.sched_priority;
  if (!state.fifo && state.missing.empty()) lacks("SCHED_FIFO was taken but does not hold");
  state.memory_locked = ::mlockall(MCL_CURRENT | MCL_FUTURE) == 0;
  if (!state.memory_locked) {
    lacks("memory is not locked (" + std::string(std::strerror(errno)) +
          "): give the program CAP_IPC_LOCK, or LimitMEMLOCK=infinity in its service");
  }
  return state;
}

}  // namespace vantage
