#include "drivers/camera/grey_conversion.h"

#include <random>
#include <vector>

#include <gtest/gtest.h>
#include <linux/videodev2.h>
#include <opencv2/imgcodecs.hpp>

namespace vantage {
namespace {

std::vector<std::uint8_t> noise(std::size_t size, unsigned seed) {
  std::mt19937 random(seed);
  std::vector<std::uint8_t> bytes(size);
  for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random());
  return bytes;
}

TEST(GreyConversion, KnowsTheFormatsAndTheirOrder) {
  const std::uint32_t best_first[] = {V4L2_PIX_FMT_GREY, V4L2_PIX_FMT_Y10,    V4L2_PIX_FMT_Y16,  V4L2_PIX_FMT_NV12,
                                      V4L2_PIX_FMT_YUYV, V4L2_PIX_FMT_SRGGB8, V4L2_PIX_FMT_MJPEG};
  for (std::size_t i = 1; i < std::size(best_first); ++i) {
    EXPECT_LT(preference(*pixel_format(best_first[i - 1])), preference(*pixel_format(best_first[i])));
  }
  EXPECT_FALSE(pixel_format(V4L2_PIX_FMT_H264));
  EXPECT_EQ(fourcc_text(V4L2_PIX_FMT_Y10), "Y10");
  EXPECT_EQ(fourcc_text(V4L2_PIX_FMT_SRGGB8), "RGGB");
}

TEST(GreyConversion, TakesTheLumaOfYuyvAndTheHighBitsOfY10AndY16) {
  constexpr int kWidth = 6, kHeight = 4;
  constexpr std::size_t kLine = 16;  // the driver pads its rows
  const std::vector<std::uint8_t> raw = noise(kLine * kHeight, 1);
  std::vector<std::uint8_t> grey(kWidth * kHeight);
  const RawImage image{raw, kWidth, kHeight, kLine};
  const auto at = [&](int x, int y) { return grey[static_cast<std::size_t>(y * kWidth + x)]; };
  const auto word = [&](int x, int y) {
    const std::size_t i = static_cast<std::size_t>(y) * kLine + 2 * static_cast<std::size_t>(x);
    return raw[i] | raw[i + 1] << 8;
  };
  ASSERT_TRUE(to_grey(PixelFormat::kYuyv, image, grey));
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) EXPECT_EQ(at(x, y), word(x, y) & 0xFF);
  }
  ASSERT_TRUE(to_grey(PixelFormat::kY16, image, grey));
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) EXPECT_EQ(at(x, y), word(x, y) >> 8);
  }
  ASSERT_TRUE(to_grey(PixelFormat::kY10, image, grey));
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) EXPECT_EQ(at(x, y), std::min(word(x, y), 1023) / 4);
  }
}

TEST(GreyConversion, BayerKeepsAnEvenGreyAndWeighsTheColoursAtEveryPixel) {
  constexpr int kWidth = 8, kHeight = 6;
  std::vector<std::uint8_t> raw(kWidth * kHeight, 77), grey(kWidth * kHeight);
  const RawImage image{raw, kWidth, kHeight, kWidth};
  ASSERT_TRUE(to_grey(PixelFormat::kBayer, image, grey));
  for (const std::uint8_t value : grey) EXPECT_EQ(value, 77);
  // RGGB of one colour: red 200, green 100, blue 40 is grey 50 + 50 + 10 wherever one looks, borders too.
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      raw[static_cast<std::size_t>(y * kWidth + x)] = y % 2 == 0 ? (x % 2 == 0 ? 200 : 100) : (x % 2 == 0 ? 100 : 40);
    }
  }
  ASSERT_TRUE(to_grey(PixelFormat::kBayer, image, grey));
  for (const std::uint8_t value : grey) EXPECT_EQ(value, 110);
}

TEST(GreyConversion, AJpegIsDecodedInPlaceAndADamagedOneIsRefused) {
  constexpr int kWidth = 64, kHeight = 48;
  cv::Mat picture(kHeight, kWidth, CV_8UC1);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) picture.at<std::uint8_t>(y, x) = static_cast<std::uint8_t>(2 * x + y);
  }
  std::vector<std::uint8_t> jpeg;
  cv::imencode(".jpg", picture, jpeg, {cv::IMWRITE_JPEG_QUALITY, 95});
  std::vector<std::uint8_t> grey(kWidth * kHeight);
  ASSERT_TRUE(to_grey(PixelFormat::kMjpeg, {jpeg, kWidth, kHeight, 0}, grey));
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      EXPECT_NEAR(grey[static_cast<std::size_t>(y * kWidth + x)], picture.at<std::uint8_t>(y, x), 4);
    }
  }
  EXPECT_FALSE(to_grey(PixelFormat::kMjpeg, {jpeg, kWidth / 2, kHeight, 0}, grey));  // of another size
  EXPECT_FALSE(to_grey(PixelFormat::kMjpeg, {noise(500, 3), kWidth, kHeight, 0}, grey));
  EXPECT_FALSE(to_grey(PixelFormat::kMjpeg, {std::span(jpeg).first(3), kWidth, kHeight, 0}, grey));
}

TEST(GreyConversion, WhatIsTooShortIsRefused) {
  std::vector<std::uint8_t> raw(2 * 8 * 4), grey(8 * 4);
  EXPECT_TRUE(to_grey(PixelFormat::kYuyv, {raw, 8, 4, 16}, grey));
  EXPECT_FALSE(to_grey(PixelFormat::kYuyv, {std::span(raw).first(63), 8, 4, 16}, grey));
  EXPECT_FALSE(to_grey(PixelFormat::kYuyv, {raw, 8, 4, 15}, grey));  // rows shorter than the picture is wide
  EXPECT_FALSE(to_grey(PixelFormat::kYuyv, {raw, 8, 4, 16}, std::span(grey).first(31)));
  EXPECT_FALSE(to_grey(PixelFormat::kGrey, {raw, 0, 4, 16}, grey));
}

}  // namespace
}  // namespace vantage
