#include "drivers/sim/server.h"

#include <cmath>
#include <random>
#include <stdexcept>
#include <string>

#include <gtest/gtest.h>

#include "calib/files/input_error.h"
#include "serving.h"

namespace vantage::sim {
namespace {

TEST(Server, EndsWellAfterAGoodbyeAndRemovesItsSocket) {
  Serving serving;
  RawPeer client(serving.path());
  ASSERT_TRUE(client.greet());
  client.say(make_message<Goodbye>());
  EXPECT_EQ(serving.join(), ServeEnd::kGoodbye);
  serving.vanish();
  EXPECT_FALSE(std::filesystem::exists(serving.path()));
}

TEST(Server, HearsTheGoodbyeOfAClientThatLeavesAnswersUnread) {
  for (int repetition = 0; repetition < 20; ++repetition) {
    Serving serving;
    RawPeer client(serving.path());
    ASSERT_TRUE(client.greet());
    client.say(make_message<Capture>());
    // Now before the answer is sent, now after.
    std::this_thread::sleep_for(std::chrono::milliseconds(repetition));
    client.say(make_message<Goodbye>());
    client.close();
    ASSERT_EQ(serving.join(), ServeEnd::kGoodbye) << repetition;
  }
}

TEST(Server, NoticesThatItsClientVanished) {
  Serving serving;
  RawPeer client(serving.path());
  ASSERT_TRUE(client.greet());
  client.close();
  EXPECT_EQ(serving.join(), ServeEnd::kClientLost);
}

TEST(Server, NoticesAClientThatVanishesDuringACapture) {
  Serving serving;
  RawPeer client(serving.path());
  ASSERT_TRUE(client.greet());
  client.say(make_message<Capture>());
  client.close();
  EXPECT_EQ(serving.join(), ServeEnd::kClientLost);
}

TEST(Server, MayServeTheNextClientAfterALostOne) {
  Serving serving(1, true);
  for (int i = 0; i < 3; ++i) {
    RawPeer client(serving.path());
    ASSERT_TRUE(client.greet());
    client.say(make_message<Capture>());
    const std::optional<Captured> captured = client.hear<Captured>();
    ASSERT_TRUE(captured);
    EXPECT_EQ(captured->pose_id, 0u);  // this client has set none
    auto pose = make_message<SetPose>();
    pose.pose_id = 7;
    write_pose(Eigen::Isometry3d::Identity(), &pose.T_world_camera);
    client.say(pose);
    ASSERT_TRUE(client.hear<PoseSet>());
    client.close();  // and goes with the only slot in its hands
  }
  RawPeer last(serving.path());
  ASSERT_TRUE(last.greet());
  last.say(make_message<Goodbye>());
  EXPECT_EQ(serving.join(), ServeEnd::kGoodbye);
}

TEST(Server, GivesUpWhenNobodyComes) {
  const ScratchFolder folder;
  const StereoCamera camera = small_stereo_camera();
  ServerOptions options;
  options.socket = folder / "sim";
  options.wait = std::chrono::seconds(1);
  Server server(camera, options);
  EXPECT_EQ(server.run(), ServeEnd::kNobodyCame);
}

TEST(Server, PeersThatNeverGreetMayComeAndGo) {
  Serving serving;
  RawPeer(serving.path()).close();
  RawPeer stranger(serving.path());
  stranger.say_bytes("GET / HTTP/1.1\r\n\r\n");
  EXPECT_TRUE(stranger.hear<Refused>());
  EXPECT_TRUE(stranger.closed());
  RawPeer client(serving.path());
  EXPECT_TRUE(client.greet());
}

TEST(Server, ASilentPeerMakesWay) {
  Serving serving;
  RawPeer silent(serving.path());
  EXPECT_TRUE(silent.closed());
  EXPECT_TRUE(RawPeer(serving.path()).greet());
}

TEST(Server, RefusesAnotherVersionAndNamesBoth) {
  Serving serving;
  RawPeer client(serving.path());
  auto hello = make_message<Hello>();
  hello.header.version = 999;
  client.say(hello);
  const auto refused = client.hear<Refused>();
  ASSERT_TRUE(refused);
  const std::string reason = refused->reason;
  EXPECT_NE(reason.find("999"), std::string::npos) << reason;
  EXPECT_NE(reason.find(" " + std::to_string(kProtocolVersion) + " "), std::string::npos) << reason;
  EXPECT_TRUE(client.closed());
}

TEST(Server, RefusesASecondClient) {
  Serving serving;
  RawPeer first(serving.path());
  ASSERT_TRUE(first.greet());
  RawPeer second(serving.path());
  EXPECT_TRUE(second.hear<Refused>());
  EXPECT_TRUE(second.closed());
  first.say(make_message<Capture>());
  EXPECT_TRUE(first.hear<Captured>());
}

TEST(Server, GarbageIsRefusedAndChangesNothing) {
  Serving serving;
  RawPeer client(serving.path());
  ASSERT_TRUE(client.greet());
  const unsigned seed = 5;
  RecordProperty("seed", static_cast<int>(seed));
  std::mt19937 random(seed);
  for (const std::size_t length : {1U, 7U, 8U, 9U, 31U, 32U, 112U, 255U, 256U, 257U, 1000U, 60000U}) {
    std::string bytes(length, '\0');
    for (char& c : bytes) c = static_cast<char>(random());
    ASSERT_TRUE(client.say_bytes(bytes));
    EXPECT_TRUE(client.hear<Refused>()) << length;
  }
  // Right kind, wrong length, version or direction.
  const auto order = make_message<SetPose>();
  client.say_bytes(std::string(reinterpret_cast<const char*>(&order), sizeof order - 1));
  EXPECT_TRUE(client.hear<Refused>());
  client.say_bytes(std::string(reinterpret_cast<const char*>(&order), sizeof order) + "x");
  EXPECT_TRUE(client.hear<Refused>());
  auto old = make_message<Capture>();
  old.header.version = 0;
  client.say(old);
  EXPECT_TRUE(client.hear<Refused>());
  client.say(make_message<Captured>());
  EXPECT_TRUE(client.hear<Refused>());
  client.say(make_message<Hello>());
  EXPECT_TRUE(client.hear<Refused>());

  client.say(make_message<Capture>());
  const auto captured = client.hear<Captured>();
  ASSERT_TRUE(captured);
  EXPECT_EQ(captured->sequence, 1U);
}

TEST(Server, RefusesPosesThatAreNotRigid) {
  Serving serving;
  RawPeer client(serving.path());
  ASSERT_TRUE(client.greet());
  const Eigen::Isometry3d good = look_at({0.4, 0.4, 0.3}, {0, 0, 0.1});
  const auto answer_to = [&](const Eigen::Isometry3d& pose) {
    auto order = make_message<SetPose>();
    order.pose_id = 7;
    write_pose(pose, &order.T_world_camera);
    client.say(order);
    return client.hear<Refused>().has_value();
  };
  Eigen::Isometry3d bad = good;
  bad.translation().y() = std::nan("");
  EXPECT_TRUE(answer_to(bad));
  bad = good;
  bad.translation().z() = HUGE_VAL;
  EXPECT_TRUE(answer_to(bad));
  bad = good;
  bad.linear() *= 1.01;
  EXPECT_TRUE(answer_to(bad));
  bad = good;
  bad.linear().col(0) *= -1;  // a mirror
  EXPECT_TRUE(answer_to(bad));

  client.say(make_message<Capture>());
  const auto captured = client.hear<Captured>();
  ASSERT_TRUE(captured);
  EXPECT_EQ(captured->pose_id, 0U);
  EXPECT_EQ(read_pose(captured->T_world_camera).matrix(), look_at({0.6, 0, 0.35}, {0, 0, 0.1}).matrix());
}

TEST(Server, ASlotIsOnlyGivenBackByWhoHoldsIt) {
  Serving serving(2);
  RawPeer client(serving.path());
  ASSERT_TRUE(client.greet());
  client.say(make_message<Capture>());
  const auto first = client.hear<Captured>();
  ASSERT_TRUE(first);
  auto release = make_message<Release>();
  for (const auto& [slot, sequence] : {std::pair<std::uint32_t, std::uint64_t>{first->slot, first->sequence + 1},
                                       {first->slot, 0},
                                       {first->slot ^ 1U, first->sequence},
                                       {1'000'000, first->sequence}}) {
    release.slot = slot;
    release.sequence = sequence;
    client.say(release);
    EXPECT_TRUE(client.hear<Refused>()) << slot << " " << sequence;
  }
  release.slot = first->slot;
  release.sequence = first->sequence;
  client.say(release);
  client.say(release);  // the second time it holds it no more
  EXPECT_TRUE(client.hear<Refused>());
}

TEST(Server, ReplacesAStaleSocketButNothingElse) {
  const ScratchFolder folder;
  { const FileDescriptor stale = listen_at(folder / "sim"); }
  ASSERT_TRUE(std::filesystem::exists(folder / "sim"));
  const FileDescriptor live = listen_at(folder / "sim");
  EXPECT_THROW(listen_at(folder / "sim"), InputError);
  folder.write("precious", "data");
  EXPECT_THROW(listen_at(folder / "precious"), InputError);
  EXPECT_EQ(std::filesystem::file_size(folder / "precious"), 4U);
  EXPECT_THROW(listen_at(folder / "no" / "such" / "folder"), InputError);
}

TEST(Server, ASocketsPathMayHaveWhatTheSystemAllows) {
  const ScratchFolder folder;
  const std::string base = (folder / "").string();
  EXPECT_TRUE(listen_at(base + std::string(107 - base.size(), 's')).valid());
  try {
    listen_at(base + std::string(108 - base.size(), 's'));
    FAIL() << "taken";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("107"), std::string::npos) << error.what();
  }
}

TEST(Server, LeavesASocketThatReplacedItsOwn) {
  const ScratchFolder folder;
  const StereoCamera camera = small_stereo_camera();
  ServerOptions options;
  options.socket = folder / "sim";
  FileDescriptor other;
  {
    const Server server(camera, options);
    std::filesystem::rename(folder / "sim", folder / "moved");
    other = listen_at(folder / "sim");
  }
  EXPECT_TRUE(std::filesystem::exists(folder / "sim"));
}

}  // namespace
}  // namespace vantage::sim
