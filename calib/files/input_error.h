#pragma once

#include <stdexcept>
#include <string>

namespace vantage {

/// A file, argument or configuration that a person gave and the program can't use.
///
/// The message is one line that names the culprit and the mend, and starts with the file (and line, where there is
/// one): "rig.yaml:7: baseline: expected a length, e.g. 0.1 m". Thrown only while a program starts or while a tool
/// reads its input; `main` prints it and exits with status 2.
class InputError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Exit statuses of all programs of the project.
enum ExitStatus : int {
  kExitOk = 0,
  kExitFailure = 1,   ///< something broke that is neither of the following
  kExitBadInput = 2,  ///< an InputError, or a command line that does not parse
  kExitPeerLost = 3   ///< another program that this one needs has gone
};

}  // namespace vantage
