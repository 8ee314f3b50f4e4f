#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

#include <Eigen/Geometry>

namespace vantage::sim {

// What the simulator and its client say to each other: one struct is one datagram on a Unix SOCK_SEQPACKET socket.
// Both run on one machine, so numbers have its byte order. docs/simulator.md tells the conversation.

inline constexpr std::uint32_t kProtocolMagic = 0x4D495356;  // "VSIM"
inline constexpr std::uint16_t kProtocolVersion = 2;

enum class MessageType : std::uint16_t {
  // client to simulator
  kHello = 1,
  kSetPose = 2,
  kCapture = 3,
  kRelease = 4,
  kGoodbye = 5,
  // simulator to client
  kWelcome = 101,
  kPoseSet = 102,
  kCaptured = 103,
  kRefused = 104
};

struct MessageHeader {
  std::uint32_t magic = kProtocolMagic;
  std::uint16_t version = kProtocolVersion;
  MessageType type{};
};

/// The upper three rows of T_world_camera, row-major.
using WirePose = double[12];

/// First word of a client. Answered by Welcome, or Refused when the version differs or another client is served.
struct Hello {
  static constexpr MessageType kType = MessageType::kHello;
  MessageHeader header;
};

/// Puts the camera somewhere else. Answered by PoseSet or, when the pose is not rigid, Refused.
struct SetPose {
  static constexpr MessageType kType = MessageType::kSetPose;
  MessageHeader header;
  std::uint64_t pose_id = 0;  ///< the client's; PoseSet and Captured repeat it
  WirePose T_world_camera{};
};

/// Software trigger. Answered by Captured, as soon as a slot is free. At most one may be under way.
struct Capture {
  static constexpr MessageType kType = MessageType::kCapture;
  MessageHeader header;
  std::uint32_t left_alone = 0;  ///< 1: the right image is not taken, and what its memory holds means nothing
  std::uint32_t reserved = 0;
};

/// Gives a slot back. Not answered, unless the client does not hold it: Refused.
struct Release {
  static constexpr MessageType kType = MessageType::kRelease;
  MessageHeader header;
  std::uint64_t sequence = 0;
  std::uint32_t slot = 0;
  std::uint32_t reserved = 0;
};

/// The client needs no more; the simulator ends well.
struct Goodbye {
  static constexpr MessageType kType = MessageType::kGoodbye;
  MessageHeader header;
};

/// Comes with the shared memory's descriptor (a sealed memfd of slots x slot_bytes). A slot holds the left image and,
/// from right_offset on, the right one; both have width bytes a row and no gaps.
struct Welcome {
  static constexpr MessageType kType = MessageType::kWelcome;
  MessageHeader header;
  std::int32_t width = 0, height = 0;
  double fx = 0, fy = 0, cx = 0, cy = 0;
  std::int32_t distortion = 0;
  std::uint32_t slots = 0;
  double coefficients[5]{};
  double baseline_m = 0;
  std::uint64_t slot_bytes = 0, right_offset = 0;
};

struct PoseSet {
  static constexpr MessageType kType = MessageType::kPoseSet;
  MessageHeader header;
  std::uint64_t pose_id = 0;
};

struct Captured {
  static constexpr MessageType kType = MessageType::kCaptured;
  MessageHeader header;
  std::uint64_t sequence = 0;
  std::uint64_t pose_id = 0;  ///< 0: the client has set none yet
  std::int64_t capture_time_ns = 0;
  double exposure_s = 0;
  WirePose T_world_camera{};
  std::uint32_t slot = 0;
  std::uint32_t reserved = 0;
};

struct Refused {
  static constexpr MessageType kType = MessageType::kRefused;
  MessageHeader header;
  char reason[120]{};  ///< one line, ends with a zero
};

/// Longest message; a receive buffer one byte longer tells an overlong datagram.
inline constexpr std::size_t kLongestMessage = 256;
static_assert(sizeof(Welcome) <= kLongestMessage && sizeof(Captured) <= kLongestMessage &&
              sizeof(Refused) <= kLongestMessage && sizeof(SetPose) <= kLongestMessage);

template <typename Message>
Message make_message() {
  Message message;
  message.header.type = Message::kType;
  return message;
}

/// Header of a datagram. False when it is too short for one or its magic number is wrong; any version passes.
inline bool read_header(std::span<const std::byte> datagram, MessageHeader* header) {
  if (datagram.size() < sizeof *header) return false;
  std::memcpy(header, datagram.data(), sizeof *header);
  return header->magic == kProtocolMagic;
}

/// A whole message. False when the datagram is not exactly one of this type and version.
template <typename Message>
bool read_message(std::span<const std::byte> datagram, Message* message) {
  MessageHeader header;
  if (datagram.size() != sizeof *message || !read_header(datagram, &header)) return false;
  if (header.version != kProtocolVersion || header.type != Message::kType) return false;
  std::memcpy(message, datagram.data(), sizeof *message);
  return true;
}

inline void write_pose(const Eigen::Isometry3d& pose, WirePose* wire) {
  Eigen::Map<Eigen::Matrix<double, 3, 4, Eigen::RowMajor>> rows(*wire);
  rows = pose.matrix().topRows<3>();
}

/// As sent; the receiver checks with is_rigid.
inline Eigen::Isometry3d read_pose(const WirePose& wire) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.matrix().topRows<3>() = Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>>(wire);
  return pose;
}

}  // namespace vantage::sim
