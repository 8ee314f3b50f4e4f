#include "drivers/camera/image_folder.h"

#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>
#include <unistd.h>

#include "tests/input_fault.h"

namespace vantage {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

class Images : public testing::Test {
 protected:
  void SetUp() override {
    char folder[] = "/tmp/images-XXXXXX";
    ASSERT_NE(::mkdtemp(folder), nullptr);
    folder_ = folder;
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  void write(const std::string& name, int grey) const {
    cv::imwrite((folder_ / name).string(), cv::Mat(4, 6, CV_8UC1, cv::Scalar(grey)));
  }

  std::filesystem::path folder_;
};

TEST_F(Images, ComeInTheOrderOfTheirNamesAtTheRateThenEnd) {
  write("b.png", 20);
  write("a.png", 10);
  write("c.png", 30);
  std::ofstream(folder_ / "notes.txt") << "no image";
  ImageFolder images({folder_, 20, false});
  Frame frame;
  std::int64_t first = 0;
  for (int i = 1; i <= 3; ++i) {
    ASSERT_EQ(images.next(&frame, seconds(1)), FrameStatus::kFrame);
    EXPECT_EQ(frame.sequence, static_cast<std::uint64_t>(i));
    EXPECT_EQ(*frame.image.pixels, 10 * i);
    EXPECT_EQ(frame.image.width, 6);
    if (i == 1) first = frame.capture_time_ns;
    EXPECT_EQ(frame.capture_time_ns - first, (i - 1) * 50'000'000);
  }
  EXPECT_EQ(images.next(&frame, seconds(1)), FrameStatus::kEnded);
  EXPECT_EQ(images.end_reason(), folder_.string() + ": all 3 images were shown");
}

TEST_F(Images, NamesThatAreTimesAreTimes) {
  write("1403636579763555584.png", 1);
  write("1403636579813555456.png", 2);
  ImageFolder images({folder_, 30, false});
  Frame first, second;
  ASSERT_EQ(images.next(&first, seconds(1)), FrameStatus::kFrame);
  ASSERT_EQ(images.next(&second, seconds(1)), FrameStatus::kFrame);
  EXPECT_EQ(second.capture_time_ns - first.capture_time_ns, 49'999'872);
}

TEST_F(Images, InRealTimeAFrameIsWaitedForButNoLongerThanAllowed) {
  write("1000000000000000000.png", 1);
  write("1000000010000000000.png", 2);  // ten seconds later
  ImageFolder images({folder_, 30, true});
  Frame frame;
  ASSERT_EQ(images.next(&frame, milliseconds(100)), FrameStatus::kFrame);
  EXPECT_EQ(images.next(&frame, milliseconds(20)), FrameStatus::kTimeout);
}

TEST_F(Images, WhatCannotBeReadIsNamed) {
  EXPECT_NE(input_fault([] { ImageFolder images({"/nonexistent"}); }).find("/nonexistent: no such folder"),
            std::string::npos);
  EXPECT_NE(input_fault([&] { ImageFolder images({folder_}); }).find("holds no image"), std::string::npos);
  std::ofstream(folder_ / "a.png") << "not a picture";
  ImageFolder images({folder_, 30, false});
  Frame frame;
  EXPECT_EQ(images.next(&frame, seconds(1)), FrameStatus::kEnded);
  EXPECT_EQ(images.end_reason(), (folder_ / "a.png").string() + ": can't be read as an image");
}

}  // namespace
}  // namespace vantage
