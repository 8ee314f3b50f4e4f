// The program as a user runs it.

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>

#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>
#include <unistd.h>

#include "calib/files/trajectory.h"
#include "tests/onboard/tracking/textured_scene.h"

namespace vantage::tracking {
namespace {

struct Outcome {
  int status;
  std::string output;
};

Outcome run_program(const std::string& arguments) {
  const std::string environment = "TSAN_OPTIONS=\"$TSAN_OPTIONS suppressions=" VANTAGE_TRACK_SUPPRESSIONS "\" ";
  FILE* pipe = ::popen((environment + VANTAGE_TRACK_PROGRAM + " " + arguments + " 2>&1").c_str(), "r");
  std::string output;
  char buffer[256];
  while (std::fgets(buffer, sizeof buffer, pipe) != nullptr) output += buffer;
  return {WEXITSTATUS(::pclose(pipe)), output};
}

class VantageTrack : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() / ("vantage-track-test-" + std::to_string(::getpid()));
    std::filesystem::create_directories(folder_ / "rgb");
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  void record(int frames) const {
    const CameraModel camera = quarter_camera();
    std::ofstream list(folder_ / "rgb.txt");
    std::vector<StampedPose> truth;
    for (int i = 0; i < frames; ++i) {
      truth.push_back({0.04 * i, TexturedScene::sway(0.04 * i)});
      const Frame frame = TexturedScene::render(camera, truth.back().T_world_camera, static_cast<std::uint64_t>(i));
      const std::string name = "rgb/" + std::to_string(1000 + i) + ".png";
      cv::imwrite((folder_ / name).string(),
                  cv::Mat(camera.height, camera.width, CV_8UC1, const_cast<std::uint8_t*>(frame.image.pixels.get())));
      list << 0.04 * i << " " << name << "\n";
    }
    write_tum_trajectory(folder_ / "groundtruth.txt", truth);
    std::ofstream(folder_ / "camera.yaml") << "fx: 250\nfy: 250\ncx: 159.5\ncy: 119.5\ndistortion: none\n";
  }

  double figure(const std::string& output, const std::string& name) const {
    const std::string line = output.substr(output.rfind("\n{") + 1);
    const auto at = line.find("\"" + name + "\": ");
    EXPECT_NE(at, std::string::npos) << name << " in " << output;
    return std::stod(line.substr(at + name.size() + 4));
  }

  std::filesystem::path folder_;
};

TEST_F(VantageTrack, WritesTheTrajectoryAndAllFiguresInItsLastLine) {
  record(60);
  const std::string out = (folder_ / "out.txt").string(), states = (folder_ / "states.txt").string();
  const Outcome outcome = run_program(folder_.string() + " --out " + out + " --states " + states);
  ASSERT_EQ(outcome.status, 0) << outcome.output;
  EXPECT_EQ(figure(outcome.output, "frames"), 60);
  EXPECT_GE(figure(outcome.output, "tracked"), 55);
  EXPECT_EQ(figure(outcome.output, "losses"), 0);
  EXPECT_EQ(figure(outcome.output, "relocalised"), 0);
  EXPECT_LT(figure(outcome.output, "ate_m"), 0.003);
  for (const char* name : {"first_pose", "ms_median", "ms_p95", "path_m", "scale"}) figure(outcome.output, name);
  EXPECT_EQ(read_tum_trajectory(out).size(), static_cast<std::size_t>(figure(outcome.output, "tracked")));
  EXPECT_TRUE(std::filesystem::exists(states));
}

TEST_F(VantageTrack, RepeatsARecordingAndSaysWhatItHolds) {
  record(40);
  const Outcome outcome = run_program(folder_.string() + " --repeat 3");
  ASSERT_EQ(outcome.status, 0) << outcome.output;
  EXPECT_EQ(figure(outcome.output, "round"), 3);
  EXPECT_EQ(figure(outcome.output, "frames"), 40);
  EXPECT_GE(figure(outcome.output, "tracked"), 35);
  EXPECT_GE(figure(outcome.output, "key_frames"), 2);
  EXPECT_GT(figure(outcome.output, "landmarks"), 100);
  EXPECT_GT(figure(outcome.output, "resident_mb"), 1);
}

TEST_F(VantageTrack, BadInputIsNamedWithStatusTwo) {
  const std::string out = " --out " + (folder_ / "out.txt").string();
  Outcome outcome = run_program("/nowhere/at-all" + out);
  EXPECT_EQ(outcome.status, 2);
  EXPECT_NE(outcome.output.find("/nowhere/at-all"), std::string::npos) << outcome.output;
  record(2);
  std::ofstream(folder_ / "rgb.txt") << "0 rgb/missing.png\n";
  outcome = run_program(folder_.string() + out);
  EXPECT_EQ(outcome.status, 2) << outcome.output;
  EXPECT_NE(outcome.output.find("missing.png"), std::string::npos) << outcome.output;
  EXPECT_EQ(run_program(folder_.string() + out + " --realtime none").status, 2);
  for (const std::string& both_or_none : {std::string(), out + " --repeat 2"}) {
    outcome = run_program(folder_.string() + both_or_none);
    EXPECT_EQ(outcome.status, 2) << outcome.output;
    EXPECT_NE(outcome.output.find("--repeat"), std::string::npos) << outcome.output;
  }
}

}  // namespace
}  // namespace vantage::tracking
