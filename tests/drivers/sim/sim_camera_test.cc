#include "drivers/sim/sim_camera.h"

#include <chrono>
#include <cmath>
#include <cstring>
#include <functional>
#include <thread>
#include <vector>

#include <gtest/gtest.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <unistd.h>

#include "calib/files/input_error.h"
#include "drivers/sim/frame_memory.h"
#include "serving.h"

namespace vantage::sim {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using std::chrono::steady_clock;

std::vector<std::uint8_t> bytes_of(const GreyImage& image) {
  std::vector<std::uint8_t> bytes;
  for (int v = 0; v < image.height; ++v) {
    const std::uint8_t* row = image.pixels.get() + v * image.stride;
    bytes.insert(bytes.end(), row, row + image.width);
  }
  return bytes;
}

TEST(SimCamera, LearnsTheCameraFromTheSimulator) {
  Serving serving;
  const SimCamera camera(serving.path());
  EXPECT_EQ(camera.camera(), serving.camera().options().camera);
  EXPECT_EQ(camera.baseline_m(), 0.1);
}

TEST(SimCamera, AFrameShowsThePoseThatWasSet) {
  Serving serving;
  SimCamera camera(serving.path());
  std::uint64_t sequence = 0;
  const std::int64_t start_ns = std::chrono::nanoseconds(steady_clock::now().time_since_epoch()).count();
  std::int64_t last_ns = start_ns;
  for (const double azimuth : {0.0, 1.0, 2.5, 4.0, 5.5}) {
    const Eigen::Isometry3d pose = look_at({0.6 * std::cos(azimuth), 0.6 * std::sin(azimuth), 0.35}, {0, 0, 0.1});
    ASSERT_TRUE(camera.set_pose(pose));
    Frame frame;
    ASSERT_EQ(camera.next(&frame, seconds(10)), FrameStatus::kFrame);
    EXPECT_EQ(frame.sequence, ++sequence);
    EXPECT_EQ(frame.exposure_s, 0.010);
    EXPECT_GE(frame.capture_time_ns, last_ns);
    last_ns = frame.capture_time_ns;
    ASSERT_TRUE(frame.T_world_camera);
    EXPECT_EQ(frame.T_world_camera->matrix(), pose.matrix());
    std::vector<std::uint8_t> left(serving.camera().pixels()), right(serving.camera().pixels());
    serving.camera().capture(pose, frame.sequence, left, right);
    EXPECT_EQ(bytes_of(frame.image), left);
    EXPECT_EQ(bytes_of(frame.right_image), right);
  }
  EXPECT_LT(last_ns, std::chrono::nanoseconds(steady_clock::now().time_since_epoch()).count());
}

TEST(SimCamera, OneEyeAloneSeesWhatItSeesInAPair) {
  Serving serving;
  SimCamera camera(serving.path(), seconds(5), SimCamera::Eyes::kLeft);
  const Eigen::Isometry3d pose = look_at({0.4, 0.4, 0.3}, {0, 0, 0.1});
  ASSERT_TRUE(camera.set_pose(pose));
  Frame frame;
  ASSERT_EQ(camera.next(&frame, seconds(10)), FrameStatus::kFrame);
  EXPECT_TRUE(frame.right_image.empty());
  std::vector<std::uint8_t> left(serving.camera().pixels()), right(serving.camera().pixels());
  serving.camera().capture(pose, frame.sequence, left, right);
  EXPECT_EQ(bytes_of(frame.image), left);
}

TEST(SimCamera, ALooseCarrierStandsBesideWhereItSays) {
  ServerOptions options;
  options.carrier_sigma_m = 0.01;
  options.carrier_sigma_rad = 0.02;
  Serving serving(options);
  SimCamera camera(serving.path(), seconds(5), SimCamera::Eyes::kLeft);
  const Eigen::Isometry3d pose = look_at({0.4, 0.4, 0.3}, {0, 0, 0.1});
  ASSERT_TRUE(camera.set_pose(pose));
  std::vector<std::vector<std::uint8_t>> seen;
  for (int i = 0; i < 2; ++i) {
    Frame frame;
    ASSERT_EQ(camera.next(&frame, seconds(10)), FrameStatus::kFrame);
    EXPECT_EQ(frame.T_world_camera->matrix(), pose.matrix());  // as the carrier says
    std::vector<std::uint8_t> there(serving.camera().pixels());
    serving.camera().capture(pose, frame.sequence, there, {});
    seen.push_back(bytes_of(frame.image));
    EXPECT_NE(seen.back(), there);
  }
  EXPECT_NE(seen[0], seen[1]);
  options.carrier_sigma_m = std::nan("");
  EXPECT_THROW(Serving{options}, std::invalid_argument);
}

TEST(SimCamera, RefusesPosesThatAreNotRigidAndStaysWhereItIs) {
  Serving serving;
  SimCamera camera(serving.path());
  const Eigen::Isometry3d pose = look_at({0.4, 0.4, 0.3}, {0, 0, 0.1});
  ASSERT_TRUE(camera.set_pose(pose));
  Eigen::Isometry3d bad = pose;
  bad.translation().x() = std::nan("");
  EXPECT_FALSE(camera.set_pose(bad));
  bad = pose;
  bad.linear() *= 2;
  EXPECT_FALSE(camera.set_pose(bad));
  Frame frame;
  ASSERT_EQ(camera.next(&frame, seconds(10)), FrameStatus::kFrame);
  EXPECT_EQ(frame.T_world_camera->matrix(), pose.matrix());
}

TEST(SimCamera, ASlotIsFilledAgainOnlyWhenBothItsImagesAreGone) {
  Serving serving(2);
  SimCamera camera(serving.path());
  Frame first, second, third;
  ASSERT_EQ(camera.next(&first, seconds(10)), FrameStatus::kFrame);
  ASSERT_EQ(camera.next(&second, seconds(10)), FrameStatus::kFrame);
  EXPECT_NE(first.image.pixels, second.image.pixels);
  const auto bytes = bytes_of(first.image);

  EXPECT_EQ(camera.next(&third, milliseconds(200)), FrameStatus::kTimeout);
  const GreyImage kept = first.image;
  first = Frame{};
  EXPECT_EQ(camera.next(&third, milliseconds(200)), FrameStatus::kTimeout);
  EXPECT_EQ(bytes_of(kept), bytes);
  second = Frame{};
  ASSERT_EQ(camera.next(&third, seconds(10)), FrameStatus::kFrame);
  EXPECT_EQ(third.sequence, 3U);
  EXPECT_EQ(bytes_of(kept), bytes);
}

TEST(SimCamera, FramesMayBeDroppedByOtherThreads) {
  Serving serving(3);
  SimCamera camera(serving.path());
  std::vector<std::thread> threads;
  for (std::uint64_t i = 1; i <= 30; ++i) {
    auto frame = std::make_shared<Frame>();
    ASSERT_EQ(camera.next(frame.get(), seconds(10)), FrameStatus::kFrame);
    EXPECT_EQ(frame->sequence, i);
    threads.emplace_back([frame = std::move(frame)]() mutable { frame.reset(); });
  }
  for (std::thread& thread : threads) thread.join();
}

TEST(SimCamera, AfterATimeoutTheSameExposureIsAwaited) {
  Serving serving;
  SimCamera camera(serving.path());
  Frame frame;
  FrameStatus status = camera.next(&frame, milliseconds(0));
  while (status == FrameStatus::kTimeout) status = camera.next(&frame, milliseconds(1));
  ASSERT_EQ(status, FrameStatus::kFrame);
  EXPECT_EQ(frame.sequence, 1U);
}

TEST(SimCamera, AnExposureUnderWayIsDroppedWhenThePoseChanges) {
  Serving serving(2);
  SimCamera camera(serving.path());
  for (int i = 0; i < 10; ++i) {
    Frame frame;
    camera.next(&frame, milliseconds(0));
    const Eigen::Isometry3d pose = look_at({0.6, 0.01 * i, 0.35}, {0, 0, 0.1});
    ASSERT_TRUE(camera.set_pose(pose));
    frame = Frame{};
    ASSERT_EQ(camera.next(&frame, seconds(10)), FrameStatus::kFrame);
    EXPECT_EQ(frame.T_world_camera->matrix(), pose.matrix());
  }
}

TEST(SimCamera, ImagesOutliveCameraAndSimulator) {
  GreyImage left, right;
  std::vector<std::uint8_t> left_bytes, right_bytes;
  {
    Serving serving;
    SimCamera camera(serving.path());
    Frame frame;
    ASSERT_EQ(camera.next(&frame, seconds(10)), FrameStatus::kFrame);
    left = frame.image;
    right = frame.right_image;
    left_bytes = bytes_of(left);
    right_bytes = bytes_of(right);
  }
  EXPECT_EQ(bytes_of(left), left_bytes);
  EXPECT_EQ(bytes_of(right), right_bytes);
}

TEST(SimCamera, TheDestructorSaysGoodbye) {
  Serving serving;
  { const SimCamera camera(serving.path()); }
  EXPECT_EQ(serving.join(), ServeEnd::kGoodbye);
}

TEST(SimCamera, EndsAtOnceWhenTheSimulatorGoes) {
  Serving serving;
  SimCamera camera(serving.path());
  EXPECT_TRUE(camera.connected());
  EXPECT_EQ(camera.end_reason(), "");
  const std::string path = serving.path().string();
  serving.vanish();
  EXPECT_FALSE(camera.connected());
  Frame frame;
  const auto asked = steady_clock::now();
  EXPECT_EQ(camera.next(&frame, seconds(10)), FrameStatus::kEnded);
  EXPECT_LT(steady_clock::now() - asked, seconds(1));
  EXPECT_EQ(camera.end_reason(), "the simulator has gone (socket " + path + ")");
  EXPECT_FALSE(camera.set_pose(Eigen::Isometry3d::Identity()));
}

TEST(SimCamera, EndsWhenTheSimulatorGoesWhileItWaits) {
  Serving serving(1);
  SimCamera camera(serving.path());
  Frame held, frame;
  ASSERT_EQ(camera.next(&held, seconds(10)), FrameStatus::kFrame);
  std::thread killer([&] {
    std::this_thread::sleep_for(milliseconds(200));
    serving.vanish();
  });
  const auto asked = steady_clock::now();
  EXPECT_EQ(camera.next(&frame, seconds(10)), FrameStatus::kEnded);
  EXPECT_LT(steady_clock::now() - asked, seconds(1));
  killer.join();
}

TEST(SimCamera, SaysWhatIsWrongWithTheSocket) {
  const ScratchFolder folder;
  const auto message = [](const std::filesystem::path& path) -> std::string {
    try {
      SimCamera camera(path, milliseconds(50));
    } catch (const InputError& error) {
      return error.what();
    }
    return "connected";
  };
  EXPECT_NE(message(folder / "nobody").find("no simulator serves there"), std::string::npos);
  EXPECT_NE(message(std::string(200, 's')).find("107 characters"), std::string::npos);
  Serving serving;
  const SimCamera first(serving.path());
  EXPECT_NE(message(serving.path()).find("serves another client"), std::string::npos);
}

TEST(SimCamera, WaitsForASimulatorThatIsStillStarting) {
  const ScratchFolder folder;
  const StereoCamera stereo = small_stereo_camera();
  std::thread late([&] {
    std::this_thread::sleep_for(milliseconds(300));
    ServerOptions options;
    options.socket = folder / "sim";
    Server(stereo, options).run();
  });
  EXPECT_NO_THROW(SimCamera(folder / "sim", seconds(10)));
  late.join();
}

/// A simulator that answers a client's greeting with what the test says.
class Impostor {
 public:
  explicit Impostor(std::function<void(RawPeer*)> play)
      : listener_(listen_at(path())), thread_([this, play = std::move(play)] {
          RawPeer client(FileDescriptor(::accept(listener_.get(), nullptr, nullptr)));
          client.hear<Hello>();
          play(&client);
          while (!client.closed()) continue;
        }) {}
  ~Impostor() { thread_.join(); }

  std::filesystem::path path() const { return folder_ / "sim"; }

 private:
  ScratchFolder folder_;
  FileDescriptor listener_;
  std::thread thread_;
};

Welcome good_welcome() {
  auto welcome = make_message<Welcome>();
  welcome.width = 8;
  welcome.height = 8;
  welcome.fx = welcome.fy = 8;
  welcome.cx = welcome.cy = 3.5;
  welcome.slots = 2;
  welcome.baseline_m = 0.1;
  welcome.slot_bytes = 128;
  welcome.right_offset = 64;
  return welcome;
}

std::string refusal_of(const Welcome& welcome, int memory) {
  Impostor impostor([&](RawPeer* client) { client->say(welcome, memory); });
  try {
    SimCamera camera(impostor.path());
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(SimCamera, RefusesASimulatorOfAnotherVersion) {
  auto welcome = good_welcome();
  welcome.header.version = kProtocolVersion + 1;
  const std::string refusal = refusal_of(welcome, -1);
  EXPECT_NE(refusal.find("version " + std::to_string(kProtocolVersion + 1)), std::string::npos) << refusal;
}

TEST(SimCamera, BelievesNoLayoutThatReachesOutsideTheMemory) {
  const FrameMemory memory(2, 64);
  EXPECT_EQ(refusal_of(good_welcome(), memory.fd()), "");
  const std::vector<std::function<void(Welcome*)>> lies = {
      [](Welcome* w) { w->width = 0; },
      [](Welcome* w) { w->height = -8; },
      [](Welcome* w) { w->width = 1 << 30; },
      [](Welcome* w) { w->height = 9; },
      [](Welcome* w) { w->slots = 0; },
      [](Welcome* w) { w->slots = 3; },
      [](Welcome* w) { w->slots = 0xFFFFFFFF; },
      [](Welcome* w) { w->slot_bytes = 127; },
      [](Welcome* w) { w->slot_bytes = ~0ULL; },
      [](Welcome* w) { w->right_offset = 63; },
      [](Welcome* w) { w->right_offset = ~0ULL - 10; },
      [](Welcome* w) { w->fx = std::nan(""); },
      [](Welcome* w) { w->distortion = 17; },
      [](Welcome* w) { w->baseline_m = -1; },
  };
  for (std::size_t i = 0; i < lies.size(); ++i) {
    Welcome welcome = good_welcome();
    lies[i](&welcome);
    EXPECT_NE(refusal_of(welcome, memory.fd()), "") << "lie " << i;
  }
}

TEST(SimCamera, TakesOnlySealedMemory) {
  EXPECT_NE(refusal_of(good_welcome(), -1), "");
  const FileDescriptor unsealed(::memfd_create("test", MFD_CLOEXEC | MFD_ALLOW_SEALING));
  ASSERT_EQ(::ftruncate(unsealed.get(), 256), 0);
  EXPECT_NE(refusal_of(good_welcome(), unsealed.get()), "");
}

TEST(SimCamera, EndsWhenTheSimulatorTalksNonsense) {
  const FrameMemory memory(2, 64);
  const std::vector<std::function<void(RawPeer*)>> nonsense = {
      [](RawPeer* client) {
        auto captured = make_message<Captured>();
        write_pose(Eigen::Isometry3d::Identity(), &captured.T_world_camera);
        captured.slot = 2;
        client->say(captured);
      },
      [](RawPeer* client) { client->say(make_message<Captured>()); },  // a pose of zeros
      [](RawPeer* client) { client->say_bytes("gibberish"); },
      [](RawPeer* client) { client->say_bytes(std::string(5000, 'x')); },
  };
  for (const auto& talk : nonsense) {
    Impostor impostor([&](RawPeer* client) {
      client->say(good_welcome(), memory.fd());
      client->hear<Capture>();
      talk(client);
    });
    SimCamera camera(impostor.path());
    Frame frame;
    EXPECT_EQ(camera.next(&frame, seconds(5)), FrameStatus::kEnded);
    EXPECT_NE(camera.end_reason().find("no message of its protocol"), std::string::npos);
  }
}

TEST(FrameMemory, CanBeWrittenByNobodyElseNorCutShort) {
  FrameMemory memory(2, 100);
  memory.right(1)[99] = 7;
  EXPECT_NE(::ftruncate(memory.fd(), 10), 0);
  EXPECT_EQ(::mmap(nullptr, 256, PROT_READ | PROT_WRITE, MAP_SHARED, memory.fd(), 0), MAP_FAILED);
  void* reading = ::mmap(nullptr, 2 * memory.slot_bytes(), PROT_READ, MAP_SHARED, memory.fd(), 0);
  ASSERT_NE(reading, MAP_FAILED);
  EXPECT_EQ(static_cast<std::uint8_t*>(reading)[memory.slot_bytes() + memory.right_offset() + 99], 7);
  ::munmap(reading, 2 * memory.slot_bytes());
}

}  // namespace
}  // namespace vantage::sim
