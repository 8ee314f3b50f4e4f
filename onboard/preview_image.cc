#include "onboard/preview_image.h"

#include <algorithm>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

namespace vantage {
namespace {

constexpr int kMostWidth = 320;
constexpr int kQuality = 70;  // of JPEG: blocks are not yet seen at this size

}  // namespace

preview_t preview_of(const GreyImage& image) {
  // OpenCV's interface is not const-correct; it only reads.
  const cv::Mat whole(image.height, image.width, CV_8UC1, const_cast<std::uint8_t*>(image.pixels.get()),
                      static_cast<std::size_t>(image.stride));
  cv::Mat small = whole;
  if (image.width > kMostWidth) {
    const int height = std::max(1, image.height * kMostWidth / image.width);
    cv::resize(whole, small, {kMostWidth, height}, 0, 0, cv::INTER_AREA);
  }
  preview_t preview{};
  preview.width = small.cols;
  preview.height = small.rows;
  cv::imencode(".jpg", small, preview.jpeg, {cv::IMWRITE_JPEG_QUALITY, kQuality});
  preview.size = static_cast<std::int32_t>(preview.jpeg.size());
  return preview;
}

}  // namespace vantage
