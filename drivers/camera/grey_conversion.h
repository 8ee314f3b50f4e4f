#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

namespace vantage {

/// How a camera lays its pixels out, as far as they can become 8-bit grey.
enum class PixelFormat {
  kGrey,   ///< 8-bit grey
  kY10,    ///< 10 bits in two bytes, little-endian
  kY16,    ///< 16 bits, little-endian
  kNv12,   ///< a plane of grey, then colour
  kYuyv,   ///< every other byte is grey
  kBayer,  ///< 8-bit mosaic of any of the four orders
  kMjpeg   ///< every picture is a JPEG
};

/// The layout behind a V4L2 four-character code; nothing when it can't become grey.
std::optional<PixelFormat> pixel_format(std::uint32_t fourcc);
/// "GREY", "YUYV"
std::string fourcc_text(std::uint32_t fourcc);

/// Lower is better: no work, less bandwidth, better grey first.
int preference(PixelFormat format);

/// True when the grey image lies in the buffer as it is, in rows of its bytesperline.
bool is_grey_in_place(PixelFormat format);

struct RawImage {
  std::span<const std::uint8_t> bytes;  ///< what the driver filled
  int width = 0, height = 0;
  std::size_t bytes_per_line = 0;  ///< unused for MJPEG
};

/// Bytes that a raw image must have at least; 0 for MJPEG.
std::size_t least_bytes(PixelFormat format, int width, int height, std::size_t bytes_per_line);

/// Converts to 8-bit grey, rows of `width` bytes without gaps, in one pass. False, with `grey` undefined, when the
/// picture is too short or no JPEG of that size.
///
/// Bayer becomes grey by the kernel 1-2-1 both ways: red and blue a quarter each, green a half, at every pixel and
/// without shifting the picture.
bool to_grey(PixelFormat format, const RawImage& raw, std::span<std::uint8_t> grey);

}  // namespace vantage
