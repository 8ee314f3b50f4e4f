// V4L2 of a real kernel: vivid's capture node shows what is written to its output node.

#include <atomic>
#include <cstring>
#include <thread>

#include <gtest/gtest.h>
#include <linux/videodev2.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include "drivers/camera/v4l2_camera.h"
#include "drivers/camera/v4l2_device.h"
#include "shell.h"
#include "tests/input_fault.h"
#include "vivid_feeder.h"

namespace vantage {
namespace {

using std::chrono::milliseconds;
using std::chrono::nanoseconds;
using std::chrono::seconds;
using std::chrono::steady_clock;

V4l2CameraOptions options_for(const std::string& format) {
  V4l2CameraOptions options;
  options.device = "/dev/video0";
  options.stream.width = kVividWidth;
  options.stream.height = kVividHeight;
  options.stream.rate_hz = 30;
  options.stream.format = format;
  return options;
}

/// Whether vivid stamps the start of an exposure, or its end, which it foretells.
void stamp_at_start(bool start) {
  shell("v4l2-ctl -d /dev/video0 -c timestamp_source=" + std::string(start ? "1" : "0"));
}

void frames_arrive_bit_exact(std::uint32_t fourcc, const std::string& format, bool in_place) {
  stamp_at_start(true);
  const VividFeeder feeder(fourcc);
  V4l2Camera camera(options_for(format));
  EXPECT_NEAR(camera.stream()->rate_hz(), 30, 0.05);
  Frame frame;
  std::int64_t first = -1, last = -1;
  std::uint64_t first_sequence = 0;
  std::int64_t first_time = 0;
  constexpr int kFrames = 90;
  for (int i = 0; i < kFrames;) {
    ASSERT_EQ(camera.next(&frame, seconds(2)), FrameStatus::kFrame) << camera.end_reason();
    ASSERT_EQ(frame.image.width, kVividWidth);
    ASSERT_EQ(frame.image.height, kVividHeight);
    const std::int64_t n = vivid_picture_number(frame.image);
    if (first < 0 && n < 0) continue;  // the output has only just begun
    ASSERT_GE(n, 0) << "frame " << i << " is not the picture that was written";
    if (first < 0) {
      first = n;
      first_sequence = frame.sequence;
      first_time = frame.capture_time_ns;
    } else {
      EXPECT_GE(n, last);
      const nanoseconds age = steady_clock::now().time_since_epoch() - nanoseconds(frame.capture_time_ns);
      EXPECT_GE(age.count(), 0);
    }
    last = n;
    ++i;
  }
  // Both nodes count with clocks of their own: over three seconds they may be a picture or two apart.
  const auto frames = static_cast<double>(frame.sequence - first_sequence);
  EXPECT_NEAR(static_cast<double>(last - first), frames, 3);
  const double rate = frames / (static_cast<double>(frame.capture_time_ns - first_time) * 1e-9);
  EXPECT_NEAR(rate, 30, 0.3);
  EXPECT_EQ(camera.counters().faulty, 0U);
  EXPECT_EQ(camera.clock().verdict(), CaptureClock::Verdict::kGood) << camera.clock().text();
  EXPECT_EQ(camera.counters().copied, in_place ? 0U : camera.counters().delivered);
  std::printf("%s: %.3f Hz, %llu delivered, %llu dropped, %llu late\n", format.c_str(), rate,
              static_cast<unsigned long long>(camera.counters().delivered),
              static_cast<unsigned long long>(camera.counters().dropped),
              static_cast<unsigned long long>(camera.counters().late));
}

TEST(V4l2, GreyFramesArriveBitExactWithoutACopy) { frames_arrive_bit_exact(V4L2_PIX_FMT_GREY, "GREY", true); }

TEST(V4l2, YuyvFramesArriveBitExact) { frames_arrive_bit_exact(V4L2_PIX_FMT_YUYV, "YUYV", false); }

TEST(V4l2, Nv12FramesArriveBitExactWithoutACopy) { frames_arrive_bit_exact(V4L2_PIX_FMT_NV12, "NV12", true); }

TEST(V4l2, TimeStampsOfTheFutureAreCorrectedAndTold) {
  stamp_at_start(false);
  V4l2Camera camera(options_for("GREY"));
  Frame frame;
  for (int i = 0; i < 30; ++i) {
    ASSERT_EQ(camera.next(&frame, seconds(2)), FrameStatus::kFrame);
    const nanoseconds age = steady_clock::now().time_since_epoch() - nanoseconds(frame.capture_time_ns);
    EXPECT_GE(age.count(), 0);
    EXPECT_LT(age, milliseconds(100));
  }
  EXPECT_EQ(camera.clock().verdict(), CaptureClock::Verdict::kCorrected);
  std::printf("%s\n", camera.clock().text().c_str());
  stamp_at_start(true);
}

TEST(V4l2, WithoutAWishTheFormatThatIsGreyAlreadyIsTaken) {
  V4l2Camera camera(options_for(""));
  EXPECT_EQ(fourcc_text(camera.stream()->fourcc()), "GREY");
}

TEST(V4l2, WhatTheCameraDoesNotOfferIsRefusedWithItsList) {
  const std::string format = input_fault([] { V4l2Camera camera(options_for("MJPG")); });
  EXPECT_NE(format.find("/dev/video0: does not offer the format MJPG; it offers "), std::string::npos) << format;
  EXPECT_NE(format.find("GREY"), std::string::npos) << format;
  V4l2CameraOptions odd = options_for("GREY");
  odd.stream.width = 100'000;
  const std::string size = input_fault([&] { V4l2Camera camera(odd); });
  EXPECT_NE(size.find("GREY 100000 x 480 becomes GREY"), std::string::npos) << size;
  V4l2CameraOptions absent = options_for("");
  absent.device = "/dev/video77";
  EXPECT_NE(input_fault([&] { V4l2Camera camera(absent); }).find("/dev/video77: can't be opened"), std::string::npos);
  V4l2CameraOptions output = options_for("");
  output.device = "/dev/video1";
  EXPECT_NE(input_fault([&] { V4l2Camera camera(output); }).find("is no camera that streams"), std::string::npos);
}

TEST(V4l2, ACameraInUseIsNamed) {
  V4l2Camera first(options_for("GREY"));
  EXPECT_NE(input_fault([] { V4l2Camera second(options_for("GREY")); }).find("another program"), std::string::npos);
}

TEST(V4l2, CaptureCanBeStartedAgainAndAgain) {
  const VividFeeder feeder(V4L2_PIX_FMT_GREY);
  for (int round = 0; round < 5; ++round) {
    V4l2Camera camera(options_for("GREY"));
    Frame frame;
    for (int i = 0; i < 5; ++i) ASSERT_EQ(camera.next(&frame, seconds(2)), FrameStatus::kFrame);
    std::int64_t n = -1;
    for (int i = 0; i < 10 && n < 0; ++i) {
      ASSERT_EQ(camera.next(&frame, seconds(2)), FrameStatus::kFrame);
      n = vivid_picture_number(frame.image);
    }
    EXPECT_GE(n, 0) << round;
  }
}

TEST(V4l2, TheWatchdogRestartsAStreamThatFallsSilent) {
  V4l2CameraOptions options = options_for("GREY");
  options.watchdog = milliseconds(300);
  V4l2Camera camera(options);
  Frame frame;
  ASSERT_EQ(camera.next(&frame, seconds(2)), FrameStatus::kFrame);
  shell("v4l2-ctl -d /dev/video0 -c percentage_of_dropped_buffers=100");
  while (camera.next(&frame, milliseconds(500)) == FrameStatus::kFrame) {
  }
  EXPECT_EQ(camera.next(&frame, milliseconds(500)), FrameStatus::kTimeout);
  EXPECT_GT(camera.counters().restarts, 0U);
  shell("v4l2-ctl -d /dev/video0 -c percentage_of_dropped_buffers=0");
  EXPECT_EQ(camera.next(&frame, seconds(2)), FrameStatus::kFrame);
}

TEST(V4l2, DroppedFramesAreCounted) {
  V4l2Camera camera(options_for("GREY"));
  shell("v4l2-ctl -d /dev/video0 -c percentage_of_dropped_buffers=40");
  Frame frame;
  std::uint64_t first = 0, got = 0;
  for (; got < 40; ++got) {
    ASSERT_EQ(camera.next(&frame, seconds(5)), FrameStatus::kFrame);
    if (got == 0) first = frame.sequence;
  }
  shell("v4l2-ctl -d /dev/video0 -c percentage_of_dropped_buffers=0");
  EXPECT_GT(camera.counters().dropped, 5U);
  EXPECT_GE(frame.sequence - first + 1, got + 5);  // the gaps show in the frames' own count
}

TEST(V4l2, FramesThatTheDriverMarksAsDamagedAreCountedAndNotShown) {
  V4l2Camera camera(options_for("GREY"));
  Frame frame;
  ASSERT_EQ(camera.next(&frame, seconds(2)), FrameStatus::kFrame);
  const std::uint64_t before = frame.sequence;
  for (int i = 0; i < 3; ++i) {
    shell("v4l2-ctl -d /dev/video0 -c inject_v4l2_buf_flag_error=1");
    ASSERT_EQ(camera.next(&frame, seconds(2)), FrameStatus::kFrame);
    ASSERT_EQ(camera.next(&frame, seconds(2)), FrameStatus::kFrame);
  }
  EXPECT_GE(camera.counters().faulty, 2U);
  EXPECT_GE(frame.sequence, before + 6 + camera.counters().faulty);  // they count in the sequence
  EXPECT_EQ(camera.counters().restarts, 0U);
}

TEST(V4l2, AFatalErrorRestartsTheStream) {
  const VividFeeder feeder(V4L2_PIX_FMT_GREY);
  V4l2Camera camera(options_for("GREY"));
  Frame frame;
  ASSERT_EQ(camera.next(&frame, seconds(2)), FrameStatus::kFrame);
  const std::uint64_t before = frame.sequence;
  frame = {};
  shell("v4l2-ctl -d /dev/video0 -c inject_fatal_streaming_error=1");
  std::int64_t n = -1;
  for (int i = 0; i < 20 && n < 0; ++i) {
    if (camera.next(&frame, seconds(1)) == FrameStatus::kFrame && camera.counters().restarts > 0) {
      n = vivid_picture_number(frame.image);
    }
  }
  EXPECT_GE(n, 0);
  EXPECT_GE(camera.counters().restarts, 1U);
  EXPECT_EQ(camera.counters().reopened, 0U);
  EXPECT_GT(frame.sequence, before);
}

TEST(V4l2, AConsumerThatComesLateGetsTheNewestFrame) {
  stamp_at_start(true);
  V4l2Camera camera(options_for("GREY"));
  Frame frame;
  ASSERT_EQ(camera.next(&frame, seconds(2)), FrameStatus::kFrame);
  for (int i = 0; i < 3; ++i) {
    frame = {};
    std::this_thread::sleep_for(milliseconds(150));  // four frames and a half
    ASSERT_EQ(camera.next(&frame, seconds(2)), FrameStatus::kFrame);
    const nanoseconds age = steady_clock::now().time_since_epoch() - nanoseconds(frame.capture_time_ns);
    EXPECT_LT(age, milliseconds(100));
  }
  EXPECT_GE(camera.counters().late, 6U);
}

TEST(V4l2, HeldFramesNeitherChangeNorStarveTheDriver) {
  const VividFeeder feeder(V4L2_PIX_FMT_GREY);
  V4l2Camera camera(options_for("GREY"));
  std::vector<Frame> held;
  std::vector<std::int64_t> numbers;
  Frame frame;
  while (held.size() < 10) {
    ASSERT_EQ(camera.next(&frame, seconds(2)), FrameStatus::kFrame);
    const std::int64_t n = vivid_picture_number(frame.image);
    if (n < 0) continue;
    held.push_back(frame);
    numbers.push_back(n);
  }
  EXPECT_GT(camera.counters().copied, 0U);
  for (int i = 0; i < 10; ++i) camera.next(&frame, seconds(2));
  for (std::size_t i = 0; i < held.size(); ++i) EXPECT_EQ(vivid_picture_number(held[i].image), numbers[i]);
}

TEST(V4l2, GainIsFixedReadBackAndRecorded) {
  shell("v4l2-ctl -d /dev/video0 -c gain_automatic=1");
  V4l2CameraOptions options = options_for("GREY");
  options.stream.settings.gain = 77;
  options.stream.settings.exposure_s = 0.01;
  V4l2Camera camera(options);
  EXPECT_EQ(output_of("v4l2-ctl -d /dev/video0 -C gain_automatic,gain"), "gain_automatic: 0\ngain: 77\n");
  Frame frame;
  ASSERT_EQ(camera.next(&frame, seconds(2)), FrameStatus::kFrame);
  EXPECT_EQ(frame.gain, 77);
  EXPECT_EQ(frame.exposure_s, 0);  // vivid has none, and says so
  ASSERT_EQ(camera.stream()->settings().notes.size(), 1U);
  EXPECT_EQ(camera.stream()->settings().notes[0], "the camera has no control for exposure");
}

TEST(V4l2, StopEndsAWaitingConsumerWithin100Ms) {
  shell("v4l2-ctl -d /dev/video0 -c percentage_of_dropped_buffers=100");
  auto camera = std::make_unique<V4l2Camera>(options_for("GREY"));
  FrameStatus status = FrameStatus::kFrame;
  steady_clock::time_point ended;
  std::thread consumer([&] {
    Frame frame;
    status = camera->next(&frame, seconds(30));
    ended = steady_clock::now();
  });
  std::this_thread::sleep_for(milliseconds(200));
  const auto asked = steady_clock::now();
  camera->stop();
  consumer.join();
  camera.reset();
  const auto stopped = steady_clock::now();
  shell("v4l2-ctl -d /dev/video0 -c percentage_of_dropped_buffers=0");
  EXPECT_EQ(status, FrameStatus::kEnded);
  EXPECT_LT(stopped - asked, milliseconds(100));
  std::printf("stopped and closed %.1f ms after the word\n",
              std::chrono::duration<double, std::milli>(stopped - asked).count());
}

TEST(V4l2, ADeviceThatGoesAndComesBackIsOpenedAnewWithinASecond) {
  const VividFeeder feeder(V4L2_PIX_FMT_GREY);
  V4l2Camera camera(options_for("GREY"));
  Frame frame;
  ASSERT_EQ(camera.next(&frame, seconds(2)), FrameStatus::kFrame);
  const std::uint64_t before = frame.sequence;
  frame = {};
  // While anybody has a node open the device stays away; the last one to close it brings it back.
  FileDescriptor keeps_it_away(::open("/dev/video1", O_RDWR));
  shell("v4l2-ctl -d /dev/video0 -c disconnect=1");
  FrameStatus status = FrameStatus::kFrame;
  for (int i = 0; i < 10 && status == FrameStatus::kFrame; ++i) status = camera.next(&frame, milliseconds(200));
  frame = {};
  EXPECT_EQ(status, FrameStatus::kTimeout);
  EXPECT_EQ(camera.next(&frame, milliseconds(300)), FrameStatus::kTimeout);
  EXPECT_EQ(camera.stream(), nullptr);
  EXPECT_EQ(camera.end_reason(), "");
  keeps_it_away.reset();
  const auto back = steady_clock::now();
  ASSERT_EQ(camera.next(&frame, seconds(5)), FrameStatus::kFrame);
  const auto waited = steady_clock::now() - back;
  EXPECT_LT(waited, seconds(1));
  EXPECT_EQ(camera.counters().reopened, 1U);
  EXPECT_GT(frame.sequence, before);
  std::printf("first frame %.0f ms after the device's return\n",
              std::chrono::duration<double, std::milli>(waited).count());
}

TEST(V4l2, CamerasAreFoundWithFormatsSizesAndRates) {
  const std::vector<CameraDescription> cameras = find_cameras();
  ASSERT_EQ(cameras.size(), 1U);  // the output node is none
  EXPECT_EQ(cameras[0].node, "/dev/video0");
  EXPECT_EQ(cameras[0].identity.driver, "vivid");
  EXPECT_EQ(find_node("/dev/video5", cameras[0].identity), "/dev/video0");  // its number has changed
  const std::string text = to_text(cameras[0]);
  for (const char* part : {"/dev/video0: vivid", "GREY", "YUYV"}) {
    EXPECT_NE(text.find(part), std::string::npos) << text;
  }
}

/// The kernel's own test picture, chequers of black and white, as a webcam (vivid's input 1) gives it in a format.
std::vector<double> chequers(const std::string& format) {
  V4l2CameraOptions options = options_for(format);
  options.stream.rate_hz = 25;
  V4l2Camera camera(options);
  Frame frame;
  for (int i = 0; i < 5; ++i) EXPECT_EQ(camera.next(&frame, seconds(2)), FrameStatus::kFrame) << camera.end_reason();
  EXPECT_EQ(camera.counters().faulty, 0U);
  std::vector<double> grey;
  for (int y = 0; y < kVividHeight; ++y) {
    const std::uint8_t* row = frame.image.pixels.get() + y * frame.image.stride;
    grey.insert(grey.end(), row, row + kVividWidth);
  }
  return grey;
}

// The last of all: vivid's other input stays in its mind.
TEST(V4l2Formats, EveryFormatShowsTheSamePicture) {
  shell("v4l2-ctl -d /dev/video0 -i 1 -c test_pattern=10 -c osd_text_mode=2");
  const std::vector<double> reference = chequers("GREY");
  const auto [darkest, brightest] = std::minmax_element(reference.begin(), reference.end());
  ASSERT_GT(*brightest - *darkest, 150) << "the test picture is flat";
  // Video range brings black from 0 to 16 and white from 255 to 235: 18 in the mean. A chequer of 16 pixels has an edge
  // of two where a bayer pattern's colours are interpolated: a quarter of all pixels, by a quarter of the range.
  for (const auto& [format, most] : std::initializer_list<std::pair<const char*, double>>{{"YUYV", 18.5},
                                                                                          {"NV12", 18.5},
                                                                                          {"Y10", 0.5},
                                                                                          {"Y16", 0.5},
                                                                                          {"BA81", 16},
                                                                                          {"GBRG", 16},
                                                                                          {"GRBG", 16},
                                                                                          {"RGGB", 16}}) {
    const std::vector<double> grey = chequers(format);
    ASSERT_EQ(grey.size(), reference.size());
    double difference = 0;
    for (std::size_t i = 0; i < grey.size(); ++i) difference += std::abs(grey[i] - reference[i]);
    difference /= static_cast<double>(grey.size());
    std::printf("%s: %.2f grey levels from GREY, mean; from %.0f to %.0f\n", format, difference,
                *std::min_element(grey.begin(), grey.end()), *std::max_element(grey.begin(), grey.end()));
    EXPECT_LT(difference, most) << format;
  }
  shell("v4l2-ctl -d /dev/video0 -i 0 -c test_pattern=0 -c osd_text_mode=0");
}

}  // namespace
}  // namespace vantage
