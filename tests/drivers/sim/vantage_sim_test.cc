// The program vantage-sim itself: its arguments, its end, and what it leaves behind.

#include <chrono>
#include <csignal>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "calib/files/ply.h"
#include "drivers/sim/sim_camera.h"
#include "scratch_folder.h"

namespace vantage::sim {
namespace {

using std::chrono::seconds;
using std::chrono::steady_clock;

std::string text_of(const std::filesystem::path& path) {
  std::ostringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

/// One run of the program, in a folder of its own that holds cube.obj.
class Program {
 public:
  Program() { folder_.write("cube.obj", kCubeObj); }
  ~Program() {
    if (pid_ > 0) {
      ::kill(pid_, SIGKILL);
      ::waitpid(pid_, nullptr, 0);
    }
  }

  std::filesystem::path operator/(const std::string& name) const { return folder_ / name; }

  void start(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "vantage-sim");
    std::vector<char*> argv;
    for (std::string& argument : arguments) argv.push_back(argument.data());
    argv.push_back(nullptr);
    const std::string out = (folder_ / "out").string(), err = (folder_ / "err").string(),
                      home = (folder_ / "").string();
    pid_ = ::fork();
    if (pid_ != 0) return;
    ::dup2(::open(out.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600), 1);
    ::dup2(::open(err.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600), 2);
    if (::chdir(home.c_str()) == 0) ::execv(VANTAGE_SIM_PROGRAM, argv.data());
    ::_exit(127);
  }

  void serve() { start({"--object", "cube.obj", "--socket", (folder_ / "sim").string()}); }
  void signal(int number) const { ::kill(pid_, number); }

  /// Exit status, or -signal.
  int wait() {
    int status = 0;
    ::waitpid(std::exchange(pid_, -1), &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
  }

  int run(const std::vector<std::string>& arguments) {
    start(arguments);
    return wait();
  }

  std::string out() const { return text_of(folder_ / "out"); }
  std::string err() const { return text_of(folder_ / "err"); }

 private:
  ScratchFolder folder_;
  pid_t pid_ = -1;
};

TEST(VantageSim, SaysWhatItServesAndEndsWithItsClientsGoodbye) {
  Program program;
  program.serve();
  {
    SimCamera camera(program / "sim", seconds(30));
    EXPECT_EQ(program.out(), "vantage-sim: serving cube.obj (0.30 m) on " + (program / "sim").string() + "\n");
    EXPECT_EQ(camera.camera().width, 752);
    EXPECT_EQ(camera.camera().height, 480);
    EXPECT_EQ(camera.camera().fx, 448);
    EXPECT_EQ(camera.baseline_m(), 0.1);
    Frame frame;
    EXPECT_EQ(camera.next(&frame, seconds(60)), FrameStatus::kFrame);
  }
  EXPECT_EQ(program.wait(), 0);
  EXPECT_EQ(program.err(), "");
  EXPECT_FALSE(std::filesystem::exists(program / "sim"));
}

TEST(VantageSim, ItsDeathEndsTheClientWithinASecond) {
  Program program;
  program.serve();
  SimCamera camera(program / "sim", seconds(30));
  program.signal(SIGKILL);
  const auto killed = steady_clock::now();
  Frame frame;
  EXPECT_EQ(camera.next(&frame, seconds(30)), FrameStatus::kEnded);
  EXPECT_LT(steady_clock::now() - killed, seconds(1));
  EXPECT_EQ(camera.end_reason(), "the simulator has gone (socket " + (program / "sim").string() + ")");
}

TEST(VantageSim, AKilledClientEndsItWithPeerLost) {
  Program program;
  program.serve();
  const pid_t client = ::fork();
  if (client == 0) {
    SimCamera camera(program / "sim", seconds(30));
    ::raise(SIGKILL);
  }
  ::waitpid(client, nullptr, 0);
  const auto killed = steady_clock::now();
  EXPECT_EQ(program.wait(), 3);
  EXPECT_LT(steady_clock::now() - killed, seconds(5));
  EXPECT_EQ(program.err(), "vantage-sim: the client has gone without a goodbye\n");
  EXPECT_FALSE(std::filesystem::exists(program / "sim"));
}

TEST(VantageSim, SignalsEndItWell) {
  for (const int number : {SIGINT, SIGTERM}) {
    Program program;
    program.serve();
    while (program.out().empty()) ::usleep(10'000);
    program.signal(number);
    EXPECT_EQ(program.wait(), 0);
    EXPECT_FALSE(std::filesystem::exists(program / "sim"));
  }
}

TEST(VantageSim, WaitsForAClientNoLongerThanToldTo) {
  Program program;
  EXPECT_EQ(program.run({"--object", "cube.obj", "--socket", "sim", "--wait", "1"}), 3);
  EXPECT_EQ(program.err(), "vantage-sim: no client came within 1 s\n");
}

TEST(VantageSim, WritesTruthAndSnapshot) {
  Program program;
  EXPECT_EQ(program.run({"--object", "cube.obj", "--object-size", "0.2", "--write-truth", "truth.ply", "--snapshot",
                         "view.png", "--pose=-0.5,0.2,0.3"}),
            0);
  EXPECT_EQ(program.err(), "");
  const PlyModel truth = read_ply(program / "truth.ply");
  EXPECT_EQ(truth.points.size(), 50'000U);
  for (const Eigen::Vector3f& p : truth.points) {
    // On the surface of the cube of 0.2 m that stands on the ground.
    const Eigen::Vector3f q = p - Eigen::Vector3f(0, 0, 0.1F);
    ASSERT_NEAR(q.cwiseAbs().maxCoeff(), 0.1F, 1e-6F);
  }
  EXPECT_EQ(text_of(program / "view.png").substr(1, 3), "PNG");
}

TEST(VantageSim, BadInputIsOneLineAndExitStatusTwoAndLeavesNothing) {
  const std::string truth = "truth.ply";
  const std::vector<std::pair<std::vector<std::string>, std::string>> cases = {
      {{"--object", "missing.ply", "--write-truth", truth}, "missing.ply"},
      {{"--object", "cube.obj", "--object-size", "0", "--write-truth", truth}, "cube.obj"},
      {{"--object", "cube.obj", "--object-size", "nan", "--write-truth", truth}, "cube.obj"},
      {{"--object", "cube.obj", "--camera-noise", "-3", "--write-truth", truth}, "--camera-noise"},
      {{"--object", "cube.obj", "--exposure", "nan", "--write-truth", truth}, "--exposure"},
      {{"--object", "cube.obj"}, "--socket"},
      {{"--socket", "here"}, "--object"},
      {{"--can", "can77"}, "can77"},
      {{"--can", "sim:no/such/folder/bus"}, "no/such/folder/bus"},
      {{"--can", "sim:bus", "--rig", "missing.yaml"}, "missing.yaml"},
      {{"--object", "cube.obj", "--socket", std::string(200, 's')}, "107"},
      {{"--object", "cube.obj", "--socket", "no/such/folder"}, "no/such/folder"},
      {{"--object", "cube.obj", "--snapshot", "view.nonsense"}, "view.nonsense"},
      {{"--object", "cube.obj", "--snapshot", "view.png", "--pose", "nan,0,0"}, "--pose"},
      {{"--object", "cube.obj", "--write-truth", "no/folder.ply"}, "no/folder.ply"},
  };
  for (const auto& [arguments, culprit] : cases) {
    Program program;
    EXPECT_EQ(program.run(arguments), 2) << culprit;
    const std::string err = program.err();
    EXPECT_NE(err.find(culprit), std::string::npos) << err;
    EXPECT_EQ(std::count(err.begin(), err.end(), '\n'), 1) << err;
    EXPECT_FALSE(std::filesystem::exists(program / truth));
    EXPECT_FALSE(std::filesystem::exists(program / "view.png"));
  }
}

TEST(VantageSim, ACommandLineThatDoesNotParseIsBadInput) {
  for (const std::vector<std::string>& arguments : {std::vector<std::string>{},
                                                    {"--object", "cube.obj", "--up", "x"},
                                                    {"--unknown"},
                                                    {"--object", "cube.obj", "--snapshot", "v.png", "--pose", "1,2"}}) {
    Program program;
    EXPECT_EQ(program.run(arguments), 2);
    EXPECT_NE(program.err(), "");
  }
}

TEST(VantageSim, TwoCannotServeAtOnePlace) {
  Program program;
  program.serve();
  SimCamera camera(program / "sim", seconds(30));
  Program second;
  EXPECT_EQ(second.run({"--object", "cube.obj", "--socket", (program / "sim").string()}), 2);
  EXPECT_NE(second.err().find("another simulator serves here already"), std::string::npos) << second.err();
  EXPECT_TRUE(camera.connected());
}

}  // namespace
}  // namespace vantage::sim
