#include "drivers/camera/grey_conversion.h"

#include <algorithm>
#include <vector>

#include <linux/videodev2.h>
#include <opencv2/imgcodecs.hpp>

namespace vantage {
namespace {

std::size_t row_bytes(PixelFormat format, int width) {
  const auto pixels = static_cast<std::size_t>(width);
  switch (format) {
    case PixelFormat::kY10:
    case PixelFormat::kY16:
    case PixelFormat::kYuyv:
      return 2 * pixels;
    default:
      return pixels;
  }
}

/// Index in [0, size) of a neighbour one outside, mirrored at the edge pixel: keeps the mosaic's parity.
int mirrored(int i, int size) {
  if (size == 1) return 0;
  if (i < 0) return -i;
  return i < size ? i : 2 * size - 2 - i;
}

void bayer_to_grey(const RawImage& raw, std::uint8_t* grey) {
  const auto row = [&raw](int y) {
    return raw.bytes.data() + static_cast<std::size_t>(mirrored(y, raw.height)) * raw.bytes_per_line;
  };
  for (int y = 0; y < raw.height; ++y) {
    const std::uint8_t *above = row(y - 1), *here = row(y), *below = row(y + 1);
    const auto column = [&](int x) { return above[x] + 2 * here[x] + below[x]; };
    for (int x = 0; x < raw.width; ++x) {
      const int sum = column(mirrored(x - 1, raw.width)) + 2 * column(x) + column(mirrored(x + 1, raw.width));
      *grey++ = static_cast<std::uint8_t>((sum + 8) / 16);
    }
  }
}

bool jpeg_to_grey(const RawImage& raw, std::span<std::uint8_t> grey) {
  if (raw.bytes.size() < 4 || raw.bytes[0] != 0xFF || raw.bytes[1] != 0xD8) return false;
  const cv::Mat bytes(1, static_cast<int>(raw.bytes.size()), CV_8UC1, const_cast<std::uint8_t*>(raw.bytes.data()));
  cv::Mat picture(raw.height, raw.width, CV_8UC1, grey.data());
  const std::uint8_t* const wanted = picture.data;
  try {
    cv::imdecode(bytes, cv::IMREAD_GRAYSCALE, &picture);
  } catch (const cv::Exception&) {
    return false;
  }
  // Of another size it was put elsewhere.
  return picture.data == wanted && picture.cols == raw.width && picture.rows == raw.height;
}

}  // namespace

std::optional<PixelFormat> pixel_format(std::uint32_t fourcc) {
  switch (fourcc) {
    case V4L2_PIX_FMT_GREY:
      return PixelFormat::kGrey;
    case V4L2_PIX_FMT_Y10:
      return PixelFormat::kY10;
    case V4L2_PIX_FMT_Y16:
      return PixelFormat::kY16;
    case V4L2_PIX_FMT_NV12:
    case V4L2_PIX_FMT_NV21:
    case V4L2_PIX_FMT_YUV420:
      return PixelFormat::kNv12;
    case V4L2_PIX_FMT_YUYV:
      return PixelFormat::kYuyv;
    case V4L2_PIX_FMT_SBGGR8:
    case V4L2_PIX_FMT_SGBRG8:
    case V4L2_PIX_FMT_SGRBG8:
    case V4L2_PIX_FMT_SRGGB8:
      return PixelFormat::kBayer;
    case V4L2_PIX_FMT_MJPEG:
    case V4L2_PIX_FMT_JPEG:
      return PixelFormat::kMjpeg;
    default:
      return {};
  }
}

std::string fourcc_text(std::uint32_t fourcc) {
  std::string text;
  for (int i = 0; i < 4; ++i) {
    const auto c = static_cast<char>(fourcc >> (8 * i) & 0x7F);
    text += c >= ' ' && c < 0x7F ? c : '?';
  }
  while (!text.empty() && text.back() == ' ') text.pop_back();
  return text;
}

int preference(PixelFormat format) { return static_cast<int>(format); }

bool is_grey_in_place(PixelFormat format) { return format == PixelFormat::kGrey || format == PixelFormat::kNv12; }

std::size_t least_bytes(PixelFormat format, int width, int height, std::size_t bytes_per_line) {
  if (format == PixelFormat::kMjpeg || height <= 0) return 0;
  return static_cast<std::size_t>(height - 1) * bytes_per_line + row_bytes(format, width);
}

bool to_grey(PixelFormat format, const RawImage& raw, std::span<std::uint8_t> grey) {
  const auto width = static_cast<std::size_t>(raw.width), height = static_cast<std::size_t>(raw.height);
  if (raw.width <= 0 || raw.height <= 0 || grey.size() < width * height) return false;
  if (format == PixelFormat::kMjpeg) return jpeg_to_grey(raw, grey);
  if (raw.bytes_per_line < row_bytes(format, raw.width) ||
      raw.bytes.size() < least_bytes(format, raw.width, raw.height, raw.bytes_per_line)) {
    return false;
  }
  if (format == PixelFormat::kBayer) {
    bayer_to_grey(raw, grey.data());
    return true;
  }
  for (std::size_t y = 0; y < height; ++y) {
    const std::uint8_t* from = raw.bytes.data() + y * raw.bytes_per_line;
    std::uint8_t* to = grey.data() + y * width;
    switch (format) {
      case PixelFormat::kYuyv:
        for (std::size_t x = 0; x < width; ++x) to[x] = from[2 * x];
        break;
      case PixelFormat::kY16:
        for (std::size_t x = 0; x < width; ++x) to[x] = from[2 * x + 1];
        break;
      case PixelFormat::kY10:
        for (std::size_t x = 0; x < width; ++x) {
          to[x] = static_cast<std::uint8_t>(std::min(from[2 * x] | from[2 * x + 1] << 8, 1023) >> 2);
        }
        break;
      default:
        std::copy_n(from, width, to);
    }
  }
  return true;
}

}  // namespace vantage
