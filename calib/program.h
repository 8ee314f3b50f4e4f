#pragma once

#include <atomic>
#include <functional>

namespace vantage {

/// Runs the body of a program's `main`: an InputError becomes one line on stderr and exit status 2, any other exception
/// one line and status 1.
int run_program(const char* name, const std::function<int()>& body);

/// From the first call on, SIGINT and SIGTERM make this true instead of ending the program.
const std::atomic<bool>& interrupt_flag();

}  // namespace vantage
