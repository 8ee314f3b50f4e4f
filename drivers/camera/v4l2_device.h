#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "calib/files/file_descriptor.h"

namespace vantage {

/// Calls ioctl again while a signal interrupts it. As ioctl: -1 and errno.
int retried_ioctl(int fd, unsigned long request, void* argument);

/// One size of a format with the frame rates the device offers at it.
struct CameraSize {
  int width = 0, height = 0;
  std::vector<double> rates_hz;  ///< highest first; of a range its ends
};

struct CameraFormat {
  std::uint32_t fourcc = 0;
  std::string description;
  std::vector<CameraSize> sizes;  ///< of a range its ends
};

/// What identifies a camera, however its node is called today.
struct CameraIdentity {
  std::string driver, card, bus;

  friend bool operator==(const CameraIdentity&, const CameraIdentity&) = default;
};

struct CameraDescription {
  std::filesystem::path node;         ///< /dev/video0
  std::filesystem::path stable_name;  ///< /dev/v4l/by-id/...; empty where udev made none
  CameraIdentity identity;
  std::vector<CameraFormat> formats;
};

/// Opens a node without blocking. Nothing, with errno set, when it is not there.
FileDescriptor open_video(const std::filesystem::path& node);

/// Who is behind a node; nothing when it is no single-planar capture device that streams.
std::optional<CameraIdentity> identify(int fd);
std::vector<CameraFormat> formats_of(int fd);

/// Every capture device of this machine, by node.
std::vector<CameraDescription> find_cameras();
/// As a person reads it: device, formats, sizes, frame rates.
std::string to_text(const CameraDescription& camera);

/// The node that `device` stands for today. A link of udev's is followed and must lead to a camera of the same kind; a
/// bare /dev/videoN must still be the camera of this identity, or another node that is. Empty: the camera is not there.
std::filesystem::path find_node(const std::filesystem::path& device, const CameraIdentity& identity);

}  // namespace vantage
