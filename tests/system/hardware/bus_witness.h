#pragma once

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <string>
#include <vector>

#include "shell.h"

namespace vantage {

/// A frame as candump has seen it.
struct SeenFrame {
  double time_s = 0;
  std::uint32_t id = 0;
  std::vector<std::uint8_t> data;
};

/// candump of can-utils, which listens to the bus independently of ours.
class BusWitness {
 public:
  explicit BusWitness(const std::string& file) : file_(file), candump_({"candump", "-L", "vcan0"}, file) {
    ::usleep(200'000);  // until it listens
  }

  std::vector<SeenFrame> frames() {
    ::usleep(100'000);
    candump_.signal(SIGTERM);
    candump_.wait();
    std::vector<SeenFrame> frames;
    std::ifstream file(file_);
    for (std::string line; std::getline(file, line);) {
      SeenFrame frame;
      unsigned id = 0;
      char bytes[32] = {};
      if (std::sscanf(line.c_str(), "(%lf) vcan0 %x#%31s", &frame.time_s, &id, bytes) < 2) continue;
      frame.id = id;
      const std::string hex = bytes;
      for (std::size_t i = 0; i + 1 < hex.size(); i += 2) {
        frame.data.push_back(static_cast<std::uint8_t>(std::stoi(hex.substr(i, 2), nullptr, 16)));
      }
      frames.push_back(frame);
    }
    return frames;
  }

 private:
  std::string file_;
  Process candump_;
};

/// The position in a TPDO 1: bytes 2 to 5.
inline std::int32_t position_in(const SeenFrame& frame) {
  return static_cast<std::int32_t>(frame.data[2] | frame.data[3] << 8 | frame.data[4] << 16 |
                                   static_cast<std::uint32_t>(frame.data[5]) << 24);
}

inline std::uint16_t statusword_in(const SeenFrame& frame) {
  return static_cast<std::uint16_t>(frame.data[0] | frame.data[1] << 8);
}

}  // namespace vantage
