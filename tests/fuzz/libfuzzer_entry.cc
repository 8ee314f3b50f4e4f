// libFuzzer's entry, built once for each target of targets.h.

#include <cstddef>

#include "targets.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  vantage::fuzz::VANTAGE_FUZZ_TARGET({data, size});
  return 0;
}
