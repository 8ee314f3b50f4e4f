// V4L2 of a real kernel: vivid's capture node shows what is written to its output node.

#include <atomic>
#include <cerrno>
#include <cstring>
#include <thread>

#include <gtest/gtest.h>
#include <linux/videodev2.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

#include "drivers/camera/v4l2_camera.h"
#include "drivers/camera/v4l2_device.h"
#include "shell.h"
#include "tests/input_fault.h"

namespace vantage {
namespace {

using std::chrono::milliseconds;
using std::chrono::nanoseconds;
using std::chrono::seconds;
using std::chrono::steady_clock;

constexpr int kWidth = 640, kHeight = 480;
constexpr std::size_t kPixels = std::size_t{kWidth} * kHeight;

/// Grey picture number n: the number in its first four pixels, then noise that n decides.
std::vector<std::uint8_t> picture(std::uint32_t n) {
  std::vector<std::uint8_t> grey(kPixels);
  std::uint64_t state = 0x9E3779B97F4A7C15ULL * (n + 1);
  for (std::size_t i = 0; i < kPixels; i += 8) {
    state ^= state << 13, state ^= state >> 7, state ^= state << 17;  // xorshift64
    std::memcpy(&grey[i], &state, 8);
  }
  std::memcpy(grey.data(), &n, sizeof n);
  return grey;
}

std::vector<std::uint8_t> as_yuyv(const std::vector<std::uint8_t>& grey) {
  std::vector<std::uint8_t> yuyv(2 * grey.size());
  for (std::size_t i = 0; i < grey.size(); ++i) {
    yuyv[2 * i] = grey[i];
    yuyv[2 * i + 1] = static_cast<std::uint8_t>(i * 7);
  }
  return yuyv;
}

/// The same with colours that do not matter, half as large as the picture, behind it.
std::vector<std::uint8_t> as_nv12(const std::vector<std::uint8_t>& grey) {
  std::vector<std::uint8_t> nv12 = grey;
  for (std::size_t i = 0; i < grey.size() / 2; ++i) nv12.push_back(static_cast<std::uint8_t>(i * 5));
  return nv12;
}

std::vector<std::uint8_t> in_format(const std::vector<std::uint8_t>& grey, std::uint32_t fourcc) {
  if (fourcc == V4L2_PIX_FMT_YUYV) return as_yuyv(grey);
  return fourcc == V4L2_PIX_FMT_NV12 ? as_nv12(grey) : grey;
}

/// The output node, streaming from mapped buffers: shows one picture a frame.
class OutputStream {
 public:
  /// Nothing when the node is not there or does not take the format.
  static std::unique_ptr<OutputStream> open(std::uint32_t fourcc) {
    std::unique_ptr<OutputStream> stream(new OutputStream);
    return stream->start(fourcc) ? std::move(stream) : nullptr;
  }
  ~OutputStream() {
    for (const std::span<std::uint8_t> buffer : buffers_) ::munmap(buffer.data(), buffer.size());
  }
  OutputStream(const OutputStream&) = delete;
  OutputStream& operator=(const OutputStream&) = delete;

  /// Waits for a free buffer, at most 100 ms, and has the picture shown. False when the node is gone.
  bool show(const std::vector<std::uint8_t>& bytes) {
    v4l2_buffer buffer = empty();
    if (filled_ < buffers_.size()) {
      buffer.index = static_cast<std::uint32_t>(filled_++);
    } else {
      pollfd polled{node_.get(), POLLOUT, 0};
      ::poll(&polled, 1, 100);
      if (::ioctl(node_.get(), VIDIOC_DQBUF, &buffer) != 0) return errno == EAGAIN;
      buffer = empty(buffer.index);
    }
    std::copy(bytes.begin(), bytes.end(), buffers_[buffer.index].begin());
    buffer.bytesused = static_cast<std::uint32_t>(bytes.size());
    buffer.field = V4L2_FIELD_NONE;
    return ::ioctl(node_.get(), VIDIOC_QBUF, &buffer) == 0;
  }

 private:
  OutputStream() = default;

  static v4l2_buffer empty(std::uint32_t index = 0) {
    v4l2_buffer buffer{};
    buffer.type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
    buffer.memory = V4L2_MEMORY_MMAP;
    buffer.index = index;
    return buffer;
  }

  bool start(std::uint32_t fourcc) {
    node_ = FileDescriptor(::open("/dev/video1", O_RDWR | O_NONBLOCK | O_CLOEXEC));
    v4l2_format format{};
    format.type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
    format.fmt.pix.width = kWidth;
    format.fmt.pix.height = kHeight;
    format.fmt.pix.pixelformat = fourcc;
    format.fmt.pix.field = V4L2_FIELD_NONE;
    v4l2_requestbuffers request{};
    request.count = 4;
    request.type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
    request.memory = V4L2_MEMORY_MMAP;
    if (!node_.valid() || ::ioctl(node_.get(), VIDIOC_S_FMT, &format) != 0 ||
        ::ioctl(node_.get(), VIDIOC_REQBUFS, &request) != 0) {
      return false;
    }
    for (std::uint32_t i = 0; i < request.count; ++i) {
      v4l2_buffer buffer = empty(i);
      if (::ioctl(node_.get(), VIDIOC_QUERYBUF, &buffer) != 0) return false;
      void* memory = ::mmap(nullptr, buffer.length, PROT_READ | PROT_WRITE, MAP_SHARED, node_.get(), buffer.m.offset);
      if (memory == MAP_FAILED) return false;
      buffers_.emplace_back(static_cast<std::uint8_t*>(memory), buffer.length);
    }
    int type = V4L2_BUF_TYPE_VIDEO_OUTPUT;
    return ::ioctl(node_.get(), VIDIOC_STREAMON, &type) == 0;
  }

  FileDescriptor node_;
  std::vector<std::span<std::uint8_t>> buffers_;
  std::size_t filled_ = 0;
};

/// Writes picture after picture to the output node, at its rate. Survives that the node goes and comes back.
class Feeder {
 public:
  explicit Feeder(std::uint32_t fourcc) : fourcc_(fourcc) {
    thread_ = std::thread([this] { run(); });
    for (int i = 0; i < 500 && written_ < 6; ++i) std::this_thread::sleep_for(milliseconds(10));
    EXPECT_GE(written_, 6) << "nothing is shown";
  }
  ~Feeder() {
    stop_ = true;
    thread_.join();
  }

 private:
  void run() {
    std::uint32_t n = 0;
    std::unique_ptr<OutputStream> output;
    while (!stop_) {
      if (output == nullptr) output = OutputStream::open(fourcc_);
      if (output == nullptr) {
        std::this_thread::sleep_for(milliseconds(20));
        continue;
      }
      const std::vector<std::uint8_t> grey = picture(n++);
      if (output->show(in_format(grey, fourcc_))) {
        ++written_;
      } else {
        output.reset();
      }
    }
  }

  std::uint32_t fourcc_;
  std::atomic<bool> stop_{false};
  std::atomic<int> written_{0};
  std::thread thread_;
};

V4l2CameraOptions options_for(const std::string& format) {
  V4l2CameraOptions options;
  options.device = "/dev/video0";
  options.stream.width = kWidth;
  options.stream.height = kHeight;
  options.stream.rate_hz = 30;
  options.stream.format = format;
  return options;
}

/// The number in a frame when it is that picture to the last bit; -1 otherwise.
std::int64_t number_of(const GreyImage& image) {
  std::uint32_t n = 0;
  std::memcpy(&n, image.pixels.get(), sizeof n);
  const std::vector<std::uint8_t> expected = picture(n);
  for (int y = 0; y < kHeight; ++y) {
    if (std::memcmp(image.pixels.get() + y * image.stride, &expected[static_cast<std::size_t>(y) * kWidth], kWidth) !=
        0) {
      return -1;
    }
  }
  return n;
}

/// Whether vivid stamps the start of an exposure, or its end, which it foretells.
void stamp_at_start(bool start) {
  shell("v4l2-ctl -d /dev/video0 -c timestamp_source=" + std::string(start ? "1" : "0"));
}

void frames_arrive_bit_exact(std::uint32_t fourcc, const std::string& format, bool in_place) {
  stamp_at_start(true);
  const Feeder feeder(fourcc);
  V4l2Camera camera(options_for(format));
  EXPECT_NEAR(camera.stream()->rate_hz(), 30, 0.05);
  Frame frame;
  std::int64_t first = -1, last = -1;
  std::uint64_t first_sequence = 0;
  std::int64_t first_time = 0;
  constexpr int kFrames = 90;
  for (int i = 0; i < kFrames;) {
    ASSERT_EQ(camera.next(&frame, seconds(2)), FrameStatus::kFrame) << camera.end_reason();
    ASSERT_EQ(frame.image.width, kWidth);
    ASSERT_EQ(frame.image.height, kHeight);
    const std::int64_t n = number_of(frame.image);
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
  const Feeder feeder(V4L2_PIX_FMT_GREY);
  for (int round = 0; round < 5; ++round) {
    V4l2Camera camera(options_for("GREY"));
    Frame frame;
    for (int i = 0; i < 5; ++i) ASSERT_EQ(camera.next(&frame, seconds(2)), FrameStatus::kFrame);
    std::int64_t n = -1;
    for (int i = 0; i < 10 && n < 0; ++i) {
      ASSERT_EQ(camera.next(&frame, seconds(2)), FrameStatus::kFrame);
      n = number_of(frame.image);
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
  const Feeder feeder(V4L2_PIX_FMT_GREY);
  V4l2Camera camera(options_for("GREY"));
  Frame frame;
  ASSERT_EQ(camera.next(&frame, seconds(2)), FrameStatus::kFrame);
  const std::uint64_t before = frame.sequence;
  frame = {};
  shell("v4l2-ctl -d /dev/video0 -c inject_fatal_streaming_error=1");
  std::int64_t n = -1;
  for (int i = 0; i < 20 && n < 0; ++i) {
    if (camera.next(&frame, seconds(1)) == FrameStatus::kFrame && camera.counters().restarts > 0) {
      n = number_of(frame.image);
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
  const Feeder feeder(V4L2_PIX_FMT_GREY);
  V4l2Camera camera(options_for("GREY"));
  std::vector<Frame> held;
  std::vector<std::int64_t> numbers;
  Frame frame;
  while (held.size() < 10) {
    ASSERT_EQ(camera.next(&frame, seconds(2)), FrameStatus::kFrame);
    const std::int64_t n = number_of(frame.image);
    if (n < 0) continue;
    held.push_back(frame);
    numbers.push_back(n);
  }
  EXPECT_GT(camera.counters().copied, 0U);
  for (int i = 0; i < 10; ++i) camera.next(&frame, seconds(2));
  for (std::size_t i = 0; i < held.size(); ++i) EXPECT_EQ(number_of(held[i].image), numbers[i]);
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
  const Feeder feeder(V4L2_PIX_FMT_GREY);
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
  for (int y = 0; y < kHeight; ++y) {
    const std::uint8_t* row = frame.image.pixels.get() + y * frame.image.stride;
    grey.insert(grey.end(), row, row + kWidth);
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
