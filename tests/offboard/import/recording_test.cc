#include "offboard/import/recording.h"

#include <fstream>
#include <iostream>

#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "offboard/session/map_check.h"
#include "tests/input_fault.h"

namespace vantage {
namespace {

namespace fs = std::filesystem;

class RecordingTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(testing::TempDir()) / testing::UnitTest::GetInstance()->current_test_info()->name();
    fs::remove_all(folder_);
    fs::create_directories(folder_ / "depth");
  }
  void write(const std::string& name, const std::string& text) { std::ofstream(folder_ / name) << text; }
  void write_depth(const std::string& name, int width, int height, std::uint16_t value) {
    cv::imwrite((folder_ / name).string(), cv::Mat(height, width, CV_16UC1, cv::Scalar(value)));
  }
  fs::path folder_;
};

const char* const kIdentity = "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
const char* const kCamera =
    "width: 8\nheight: 6\nfx: 10\nfy: 10\ncx: 4\ncy: 3\ndistortion: none\ndepth_scale_m: 0.0002\n";

TEST_F(RecordingTest, SevenScenesIsFoundAndPosed) {
  write_depth("frame-000030.depth.png", 640, 480, 1500);
  write("frame-000030.pose.txt", "1 0 0 4\n0 1 0 5\n0 0 1 6\n0 0 0 1\n");
  const Recording recording = open_recording(folder_);
  EXPECT_EQ(recording.layout, RecordingLayout::kSevenScenes);
  ASSERT_EQ(recording.frames.size(), 1u);
  EXPECT_EQ(recording.frames[0].time_s, 1.0);
  EXPECT_EQ(recording.frames[0].T_world_camera.translation(), Eigen::Vector3d(4, 5, 6));
  EXPECT_EQ(recording.camera.camera.fx, 585);
  const DepthMap map = read_recorded_depth(recording.frames[0], recording.camera, {}, 5);
  EXPECT_TRUE(map.valid());
  EXPECT_FLOAT_EQ(map.depth_m[1000], 1.5F);
  EXPECT_FLOAT_EQ(map.sigma_m[1000], 0.001425F * 1.5F * 1.5F);
}

TEST_F(RecordingTest, TumTakesTheNearestPoseWithin20ms) {
  write("camera.yaml", kCamera);
  write("depth.txt", "# list\n1.000 depth/a.png\n2.000 depth/b.png\n3.000 depth/c.png\n");
  write("groundtruth.txt", "0.99 1 0 0 0 0 0 1\n1.005 2 0 0 0 0 0 1\n2.03 3 0 0 0 0 0 1\n3.0 4 0 0 0 0 0 1\n");
  for (const char* name : {"depth/a.png", "depth/b.png", "depth/c.png"}) write_depth(name, 8, 6, 5000);
  const Recording recording = open_recording(folder_);
  EXPECT_EQ(recording.layout, RecordingLayout::kTum);
  ASSERT_EQ(recording.frames.size(), 2u);
  EXPECT_EQ(recording.without_pose, 1u);
  EXPECT_EQ(recording.frames[0].T_world_camera.translation().x(), 2);
  EXPECT_EQ(recording.frames[1].T_world_camera.translation().x(), 4);
  EXPECT_FLOAT_EQ(read_recorded_depth(recording.frames[0], recording.camera, {}, 5).depth_m[0], 1.0F);
}

TEST_F(RecordingTest, APlainTrajectoryWithImagesNamedByTime) {
  write("camera.yaml", kCamera);
  write("trajectory.txt", "1.5 1 0 0 0 0 0 1\n12.25 2 0 0 0 0 0 1\n");
  write_depth("depth/12.25.png", 8, 6, 5000);
  write_depth("depth/1.5.png", 8, 6, 5000);
  const Recording recording = open_recording(folder_);
  EXPECT_EQ(recording.layout, RecordingLayout::kTrajectory);
  ASSERT_EQ(recording.frames.size(), 2u);
  EXPECT_EQ(recording.frames[0].time_s, 1.5);  // by time, not by name
}

TEST_F(RecordingTest, ZeroAndAllOnesAndTooFarAreNoMeasurement) {
  write("frame-000001.pose.txt", kIdentity);
  for (const auto& [value, state] : {std::pair<std::uint16_t, DepthState>{0, DepthState::kInvalid},
                                     {65535, DepthState::kInvalid},
                                     {5001, DepthState::kInvalid},
                                     {5000, DepthState::kConverged}}) {
    write_depth("frame-000001.depth.png", 640, 480, value);
    const Recording recording = open_recording(folder_);
    EXPECT_EQ(read_recorded_depth(recording.frames[0], recording.camera, {}, 5).state[7], state) << value;
  }
}

TEST_F(RecordingTest, FaultsAreNamed) {
  EXPECT_NE(input_fault([&] { open_recording(folder_ / "none"); }).find("no such folder"), std::string::npos);
  EXPECT_NE(input_fault([&] { open_recording(folder_); }).find("holds no recording"), std::string::npos);
  write_depth("frame-000001.depth.png", 320, 240, 1000);
  EXPECT_NE(input_fault([&] { open_recording(folder_); }).find("there is no frame-000001.pose.txt"), std::string::npos);
  write("frame-000001.pose.txt", "1 0 0 nan\n0 1 0 0\n0 0 1 0\n0 0 0 1\n");
  EXPECT_NE(input_fault([&] { open_recording(folder_); }).find("frame-000001.pose.txt:1: the number nan is not finite"),
            std::string::npos);
  write("frame-000001.pose.txt", kIdentity);
  const Recording recording = open_recording(folder_);
  EXPECT_NE(input_fault([&] {
              read_recorded_depth(recording.frames[0], recording.camera, {}, 5);
            }).find("is 320 x 240 pixels, the recording's camera 640 x 480"),
            std::string::npos);
  cv::imwrite((folder_ / "frame-000001.depth.png").string(), cv::Mat(480, 640, CV_8UC1, cv::Scalar(7)));
  EXPECT_NE(input_fault([&] { read_recorded_depth(recording.frames[0], recording.camera, {}, 5); }).find("no 16-bit"),
            std::string::npos);
  write("frame-000001.depth.png", "no image");
  EXPECT_NE(
      input_fault([&] { read_recorded_depth(recording.frames[0], recording.camera, {}, 5); }).find("can't be read"),
      std::string::npos);
}

/// Real Kinect depth: every fifth map is kept out and must lie on the map that the others make.
TEST(RealRecording, LeftOutDepthMapsOfSevenScenesLieOnTheMap) {
  const fs::path folder = fs::path(VANTAGE_SOURCE_DIR) / ".." / "shared" / "data" / "sevenscenes_500";
  if (!fs::exists(folder)) {
    std::cerr << "\n*** NOT TESTED: the recording " << folder << " is absent ***\n\n";
    GTEST_SKIP() << "the recording is absent";
  }
  const Recording recording = open_recording(folder);
  ASSERT_EQ(recording.frames.size(), 50u);
  SensorModel sensor;
  sensor.max_range_m = 6.5;
  OccupancyMap map({{-2.6, -1.6, -0.6}, {260, 150, 220}, 0.02}, sensor);
  std::vector<DepthMap> left_out, used;
  for (std::size_t i = 0; i < recording.frames.size(); ++i) {
    const DepthMap depth_map = read_recorded_depth(recording.frames[i], recording.camera, {}, 5);
    if (i % 5 == 4) {
      left_out.push_back(depth_map);
      continue;
    }
    ASSERT_TRUE(map.integrate(depth_map).ok);
    used.push_back(depth_map);
  }
  MapCheck check, cameras;
  for (const DepthMap& depth_map : left_out) check_depth_map(map, depth_map, 2, &check);
  for (const DepthMap& depth_map : used) check_depth_map(map, depth_map, 0, &cameras);
  std::cout << "left-out points within two voxels of an occupied one: " << check.share() << "\n";
  EXPECT_GE(check.share(), 0.80);
  EXPECT_EQ(check.cameras_in_occupied + cameras.cameras_in_occupied, 0);
}

}  // namespace
}  // namespace vantage
