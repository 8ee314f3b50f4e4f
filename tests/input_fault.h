#pragma once

#include <functional>
#include <string>

#include "calib/files/input_error.h"

namespace vantage {

/// The message of the InputError that `action` throws; empty when it throws none.
inline std::string input_fault(const std::function<void()>& action) {
  try {
    action();
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

}  // namespace vantage
