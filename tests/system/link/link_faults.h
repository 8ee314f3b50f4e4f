#pragma once

#include <string>
#include <vector>

namespace vantage {

struct FaultArguments {
  std::string key, file, log;
  int count = 10'000;
  std::vector<int> pids;
  unsigned seed = 1;
};

// Each tells in one line what came of it; the exit status is 0 when nothing was lost, obeyed, grown or dead.

/// Writes down every acknowledgement of a depth map that goes over the network, until it is ended.
int witness_acknowledgements(const FaultArguments& arguments);
/// Holds what a witness wrote against the planner's log.
int verify_acknowledgements(const FaultArguments& arguments);
/// Waits until a planner has commanded and gone, then commands in its place in every way that must not work.
int forge_commands(const FaultArguments& arguments);
/// Sends datagrams like those under way, but not quite, to two programs whose memory it watches.
int mutate_datagrams(const FaultArguments& arguments);

}  // namespace vantage
