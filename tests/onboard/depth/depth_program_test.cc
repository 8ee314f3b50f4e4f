#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "drivers/sim/boxes_room.h"
#include "drivers/sim/recording.h"

namespace vantage {
namespace {

namespace fs = std::filesystem;

/// What a program printed, both streams, and its exit status.
struct Ended {
  std::string output;
  int status = -1;
};

Ended run_depth(const std::string& arguments) {
  Ended run;
  FILE* pipe = popen((std::string(VANTAGE_DEPTH_PROGRAM) + " " + arguments + " 2>&1").c_str(), "r");
  char buffer[512];
  while (fgets(buffer, sizeof buffer, pipe) != nullptr) run.output += buffer;
  run.status = WEXITSTATUS(pclose(pipe));
  return run;
}

/// The number behind `"name": ` in the last line.
double figure(const Ended& run, const std::string& name) {
  const std::size_t at = run.output.rfind("\"" + name + "\": ");
  return at == std::string::npos ? -1 : std::stod(run.output.substr(at + name.size() + 4));
}

class DepthProgramTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("depth_program_" + std::to_string(getpid()) + "_" +
                                           testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  /// A recording of the simulated room, small, with the truth of frame 0.
  fs::path record(sim::CameraPath path, int frames) {
    sim::RecordingOptions options;
    options.camera = {.width = 320, .height = 240, .fx = 230, .fy = 230, .cx = 159.5, .cy = 119.5, .coefficients = {}};
    options.path = path;
    options.frames = frames;
    options.truth_depth_every = frames;
    sim::write_recording(sim::boxes_room(3), options, folder_ / "recording");
    return folder_ / "recording";
  }

  fs::path folder_;
};

TEST_F(DepthProgramTest, FindsTheDepthOfTheSimulatedRoom) {
  struct Case {
    sim::CameraPath path;
    int frames;
    double completeness, precision, error;
  };
  // At half the resolution of the bars in docs/depth.md; a border of 6 pixels is 9 % of these images.
  for (const Case& c :
       {Case{sim::CameraPath::kHover, 46, 0.70, 0.97, 0.006}, Case{sim::CameraPath::kSlide, 31, 0.65, 0.95, 0.008},
        Case{sim::CameraPath::kForward, 31, 0.50, 0.93, 0.015}}) {
    const fs::path recording = record(c.path, c.frames);
    const Ended run = run_depth(recording.string() + " --frames " + std::to_string(c.frames - 1) + " --out " +
                                (folder_ / "out").string());
    ASSERT_EQ(run.status, 0) << run.output;
    EXPECT_EQ(figure(run, "frames"), c.frames - 1);
    EXPECT_GT(figure(run, "completeness_5"), c.completeness) << run.output;
    EXPECT_GT(figure(run, "precision_5"), c.precision) << run.output;
    EXPECT_LT(figure(run, "median_rel_error"), c.error) << run.output;
    EXPECT_GT(figure(run, "smoothed_precision_5"), figure(run, "precision_5") - 0.002) << run.output;
    for (const char* name : {"depth.png", "smoothed.png", "cloud.ply", "picture.png"}) {
      EXPECT_GT(fs::file_size(folder_ / "out" / name), 1000U) << name;
    }
    fs::remove_all(recording);
  }
}

TEST_F(DepthProgramTest, KnowsTheUnitOfLengthAsWellAsExactPosesDo) {
  // The bars of the simulated hover, at full size; the poses are exact, and stated to be known to 1 mm and 0.05
  // degrees.
  for (const std::uint32_t room : {2U, 8U}) {
    SCOPED_TRACE(testing::Message() << "room " << room);
    sim::RecordingOptions options;
    options.frames = 61;
    options.truth_depth_every = 60;
    const fs::path recording = folder_ / "recording";
    sim::write_recording(sim::boxes_room(room), options, recording);
    const Ended run = run_depth(recording.string() + " --frames 60 --out " + (folder_ / "out").string());
    ASSERT_EQ(run.status, 0) << run.output;
    EXPECT_GE(figure(run, "completeness_5"), 0.75) << run.output;
    EXPECT_GE(figure(run, "precision_5"), 0.97) << run.output;
    EXPECT_LE(figure(run, "median_rel_error"), 0.002) << run.output;
    fs::remove_all(recording);
  }
}

TEST_F(DepthProgramTest, BadInputIsNamed) {
  const fs::path recording = record(sim::CameraPath::kHover, 2);
  const std::string out = " --out " + (folder_ / "out").string();
  const auto expect = [&](const std::string& arguments, const std::string& named) {
    const Ended run = run_depth(arguments + out);
    EXPECT_EQ(run.status, 2) << run.output;
    EXPECT_NE(run.output.find(named), std::string::npos) << run.output;
  };
  expect((folder_ / "nothing").string(), "camera.yaml");
  expect(recording.string() + " --reference 1", "--reference");
  expect(recording.string() + " --reference -1", "--reference");
  expect(recording.string() + " --frames 0", "--frames");
  expect(recording.string() + " --min 2 --max 1", "--min");
  expect(recording.string() + " --pose-sigma -1", "--pose-sigma");
  std::ofstream(recording / "rgb" / "00001.png") << "no image";
  expect(recording.string(), "00001.png");
  fs::remove(recording / "groundtruth.txt");
  expect(recording.string(), "trajectory.txt");
}

/// The published filter, restated, on the same frames (docs/depth.md): converged and right, shares.
struct Published {
  int key_frame;
  double converged, precision;
};

TEST(RealDepthTest, BeatsThePublishedFilterOnSevenScenes) {
  const fs::path folder = fs::path(VANTAGE_SOURCE_DIR) / "../shared/data/sevenscenes_500";
  if (!fs::exists(folder)) GTEST_SKIP() << "NOT TESTED: the recording " << folder << " is absent";
  for (const Published& p : {Published{120, 0.049, 0.36}, Published{240, 0.435, 0.68}, Published{360, 0.208, 0.17}}) {
    const Ended run =
        run_depth(folder.string() + " --reference " + std::to_string(p.key_frame) + " --frames 45 --out " +
                  (fs::temp_directory_path() / ("depth_real_" + std::to_string(getpid()))).string());
    ASSERT_EQ(run.status, 0) << run.output;
    EXPECT_GT(figure(run, "converged"), p.converged) << run.output;
    EXPECT_GT(figure(run, "precision_5"), p.precision) << run.output;
  }
  fs::remove_all(fs::temp_directory_path() / ("depth_real_" + std::to_string(getpid())));
}

}  // namespace
}  // namespace vantage
