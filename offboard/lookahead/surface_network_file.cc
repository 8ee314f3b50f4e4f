// The bytes of surface_network.bin, as a part of the program.

#include "offboard/lookahead/surface_network_file.h"

// NOLINTNEXTLINE: #embed is C++26
asm(".pushsection .rodata\n"
    ".balign 16\n"
    ".global vantage_surface_network_begin\n"
    "vantage_surface_network_begin:\n"
    ".incbin \"" VANTAGE_SURFACE_NETWORK
    "\"\n"
    ".global vantage_surface_network_end\n"
    "vantage_surface_network_end:\n"
    ".byte 0\n"
    ".popsection\n");

extern "C" const unsigned char vantage_surface_network_begin[], vantage_surface_network_end[];

namespace vantage {

std::span<const unsigned char> surface_network_file() {
  return {vantage_surface_network_begin, vantage_surface_network_end};
}

}  // namespace vantage
