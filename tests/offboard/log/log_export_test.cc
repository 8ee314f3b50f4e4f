#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <sstream>

#include <opencv2/imgcodecs.hpp>

#include "calib/files/ply.h"
#include "calib/files/trajectory.h"
#include "offboard/import/recording.h"
#include "offboard/log/cloud_export.h"
#include "offboard/log/image_export.h"
#include "offboard/log/log_info.h"
#include "offboard/log/mcap_export.h"
#include "offboard/log/state_colors.h"
#include "offboard/log/trajectory_export.h"
#include "tests/input_fault.h"
#include "tests/offboard/log/log_folder.h"
#include "tests/offboard/log/sample_log.h"

namespace vantage {
namespace {

namespace fs = std::filesystem;

using Export = LogFolder;

TEST_F(Export, TrajectoriesOfMapsAndOfStates) {
  write_sample_log(log_, 3);
  EXPECT_EQ(export_trajectory(log_, PoseSource::kDepthMaps, folder_ / "maps.txt").poses, 3);
  const std::vector<StampedPose> maps = read_tum_trajectory(folder_ / "maps.txt");
  ASSERT_EQ(maps.size(), 3u);
  for (int n = 1; n <= 3; ++n) {
    const StampedPose& pose = maps[static_cast<std::size_t>(n) - 1];
    EXPECT_EQ(std::llround(pose.time_s * 1e6), kSampleStart + 500'000 * n);
    EXPECT_TRUE(pose.T_world_camera.isApprox(sample_map(n).T_world_camera, 1e-8));
  }
  EXPECT_EQ(export_trajectory(log_, PoseSource::kRobotStates, folder_ / "states.txt").poses, 15);
  const std::vector<StampedPose> states = read_tum_trajectory(folder_ / "states.txt");
  ASSERT_EQ(states.size(), 15u);
  EXPECT_EQ(std::llround(states[6].time_s * 1e6), kSampleStart + 700'000);
  EXPECT_NEAR(states[6].T_world_camera.translation().z(), 0.2, 1e-8);
}

TEST_F(Export, AMapThatComesTwiceIsOnePose) {
  {
    SampleLog log(log_);
    log.map(sample_map(2));
    log.map(sample_map(1));
    log.map(sample_map(2));
  }
  const TrajectoryExport result = export_trajectory(log_, PoseSource::kDepthMaps, folder_ / "maps.txt");
  EXPECT_EQ(result.poses, 2);
  EXPECT_EQ(result.left_out, 1);
  EXPECT_EQ(read_tum_trajectory(folder_ / "maps.txt").size(), 2u);  // and in order
  EXPECT_NE(input_fault([this] {
              export_trajectory(log_, PoseSource::kRobotStates, folder_ / "none.txt");
            }).find("holds no robot state; --tum-from maps"),
            std::string::npos);
  EXPECT_FALSE(fs::exists(folder_ / "none.txt"));
}

/// What was packed comes back through the recording within half a step of the image and the codec's error.
TEST_F(Export, ImagesAreARecordingThatImportReads) {
  {
    SampleLog log(log_);
    log.map(sample_map(1));
    const auto [manifest, chunks] = in_chunks(sample_map(2));
    log.write(kSampleStart, channel::kDepthManifest, manifest);
    for (const depth_map_chunk_t& chunk : chunks) log.write(kSampleStart, channel::kDepthChunk, chunk);
  }
  const fs::path images = folder_ / "images";
  const ImageExport result = export_images(log_, images, false);
  EXPECT_EQ(result.depth_maps, 2);
  EXPECT_EQ(result.too_far, 0);
  const Recording recording = open_recording(images);
  EXPECT_EQ(recording.layout, RecordingLayout::kTum);
  EXPECT_EQ(recording.without_pose, 0u);
  ASSERT_EQ(recording.frames.size(), 2u);
  for (int n = 1; n <= 2; ++n) {
    const DepthMap map = sample_map(n);
    const RecordedDepth& frame = recording.frames[static_cast<std::size_t>(n) - 1];
    EXPECT_TRUE(frame.T_world_camera.isApprox(map.T_world_camera, 1e-8));
    const DepthMap again = read_recorded_depth(frame, recording.camera, {}, 5);
    EXPECT_EQ(again.camera.fx, map.camera.fx);
    EXPECT_EQ(again.camera.cy, map.camera.cy);
    const std::string name = "170000000" + std::string(n == 1 ? "0.500000" : "1.000000") + ".png";
    const cv::Mat sigma = cv::imread((images / "sigma" / name).string(), cv::IMREAD_UNCHANGED);
    const cv::Mat state = cv::imread((images / "state" / name).string(), cv::IMREAD_UNCHANGED);
    ASSERT_EQ(sigma.type(), CV_16UC1);
    ASSERT_EQ(state.type(), CV_8UC3);
    ASSERT_EQ(again.state.size(), map.state.size());
    for (std::size_t i = 0; i < map.state.size(); ++i) {
      const int u = static_cast<int>(i) % 64, v = static_cast<int>(i) / 64;
      const bool converged = map.state[i] == DepthState::kConverged;
      ASSERT_EQ(again.state[i] != DepthState::kInvalid, converged) << i;  // import finds its own edges
      if (converged) {
        // the step of the image, and what depth_codec.h rounds
        ASSERT_NEAR(again.depth_m[i], map.depth_m[i], kDepthImageStep_m / 2 + map.sigma_m[i] / 16 + 5e-5) << i;
      }
      const double sigma_m = sigma.at<std::uint16_t>(v, u) * kSigmaImageStep_m;
      if (map.state[i] == DepthState::kInvalid) {
        ASSERT_EQ(sigma_m, 0);
      } else {
        ASSERT_NEAR(sigma_m, static_cast<double>(map.sigma_m[i]), kSigmaImageStep_m / 2 + 0.033 * sigma_m) << i;
      }
      const std::array<std::uint8_t, 3> color = color_of(map.state[i]);
      ASSERT_EQ(state.at<cv::Vec3b>(v, u), cv::Vec3b(color[2], color[1], color[0])) << i;
    }
  }
}

TEST_F(Export, ImagesReplaceOnlyAnEarlierExport) {
  write_sample_log(log_, 2);
  const fs::path images = folder_ / "images";
  fs::create_directories(images);
  std::ofstream(images / "notes.txt") << "mine";
  EXPECT_NE(input_fault([&] { export_images(log_, images, false); }).find("images: is not empty"), std::string::npos);
  EXPECT_EQ(export_images(log_, images, true).depth_maps, 2);
  write_sample_log(log_, 1);
  EXPECT_EQ(export_images(log_, images, true).depth_maps, 1);
  EXPECT_EQ(std::distance(fs::directory_iterator(images / "depth"), fs::directory_iterator()), 1);
  EXPECT_TRUE(fs::exists(images / "notes.txt"));
}

TEST_F(Export, ImagesOfTwoCamerasAreRefusedAndLeaveNothing) {
  {
    SampleLog log(log_);
    log.map(sample_map(1));
    log.map(sample_map(2, 32, 24));
  }
  EXPECT_NE(input_fault([this] { export_images(log_, folder_ / "images", false); }).find("different cameras"),
            std::string::npos);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()), 1);
}

/// Each point of the cloud is a converged pixel's, projected by hand, and each such pixel has a point near it.
TEST_F(Export, TheCloudIsTheConvergedPixels) {
  write_sample_log(log_, 3);
  constexpr double kSpacing = 0.01;
  const CloudExport result =
      export_cloud(log_, {.session_region = false, .spacing_m = kSpacing}, folder_ / "cloud.ply");
  EXPECT_EQ(result.depth_maps, 3);
  const PlyModel cloud = read_ply(folder_ / "cloud.ply");
  ASSERT_EQ(cloud.points.size(), result.points);
  ASSERT_EQ(cloud.normals.size(), result.points);
  std::vector<Eigen::Vector3d> pixels;
  for (int n = 1; n <= 3; ++n) {
    const DepthMap map = sample_map(n);
    for (std::size_t i = 0; i < map.state.size(); ++i) {
      if (map.state[i] != DepthState::kConverged) continue;
      const double z = map.depth_m[i], u = static_cast<double>(i % 64), v = static_cast<double>(i / 64);
      pixels.push_back(map.T_world_camera * Eigen::Vector3d((u - 32) / 38.4 * z, (v - 24) / 38.4 * z, z));
    }
  }
  EXPECT_LE(cloud.points.size(), pixels.size());
  const auto nearest = [](const auto& points, const Eigen::Vector3d& to) {
    double best = 1e9;
    for (const auto& point : points) best = std::min(best, (point.template cast<double>() - to).squaredNorm());
    return std::sqrt(best);
  };
  for (const Eigen::Vector3f& point : cloud.points) ASSERT_LT(nearest(pixels, point.cast<double>()), 2e-4);
  for (const Eigen::Vector3d& pixel : pixels) ASSERT_LT(nearest(cloud.points, pixel), kSpacing * std::sqrt(3.0) + 2e-4);
  for (const Eigen::Vector3f& normal : cloud.normals) ASSERT_NEAR(normal.norm(), 1, 1e-5);
}

TEST_F(Export, TheSessionsRegionLeavesTheRestOut) {
  SessionConfig config;
  config.region = Region::cube({0.1, -0.2, 0.9}, 0.4, 0.01);
  {
    SampleLog log(log_);
    log.config(kSampleStart, config);
    log.map(sample_map(1));
  }
  const CloudExport all = export_cloud(log_, {}, folder_ / "all.ply");
  const CloudExport session =
      export_cloud(log_, {.session_region = true, .spacing_m = std::nullopt}, folder_ / "cloud.ply");
  EXPECT_LT(session.points, all.points);
  for (const Eigen::Vector3f& point : read_ply(folder_ / "cloud.ply").points) {
    Eigen::Vector3i voxel;
    ASSERT_TRUE(config.region.voxel_at(point.cast<double>(), &voxel));
  }
}

TEST_F(Export, ADamagedLogIsRefusedAndLeavesNothing) {
  write_sample_log(log_, 2);
  {
    std::fstream file(log_, std::ios::in | std::ios::out | std::ios::binary);
    file.put('x');
  }
  EXPECT_NE(input_fault([this] { export_mcap(log_, folder_ / "log.mcap"); }).find("`vantage-log cut`"),
            std::string::npos);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()), 1);
}

class Mcap : public LogFolder {
 protected:
  /// Exit status of the format's own reader over what was exported; 77 where it is not there.
  int read_with_mcap_core(int fewest_chunks) {
    std::ofstream info(folder_ / "info.txt");
    print_log_info(log_, read_log_info(log_), info);
    info.close();
    const std::string reader = VANTAGE_SOURCE_DIR "/build/mcap-reader";
    if (!fs::exists(reader) || std::system("command -v node >/dev/null") != 0) return 77;
    const std::string command = "node " VANTAGE_SOURCE_DIR "/tests/offboard/log/check_mcap.mjs " + reader + " " +
                                log_.string() + " " + (folder_ / "log.mcap").string() + " " +
                                (folder_ / "info.txt").string() + " " + std::to_string(fewest_chunks) + " >" +
                                (folder_ / "reader.txt").string() + " 2>&1";
    const int status = std::system(command.c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  std::string reader_says() const {
    std::ifstream in(folder_ / "reader.txt");
    return {std::istreambuf_iterator<char>(in), {}};
  }
};

constexpr const char* kNoReader = "no @mcap/core reader here: run scripts/fetch-mcap-reader (needs npm and a network)";

TEST_F(Mcap, ItsOwnReaderFindsEveryEventAgain) {
  write_sample_log(log_, 60, {.part_bytes = 200'000});
  ASSERT_GT(count_log_parts(log_), 1u);
  const McapExport result = export_mcap(log_, folder_ / "log.mcap");
  EXPECT_EQ(result.events, 1u + 60 * 7);
  EXPECT_EQ(result.faulty, 0u);
  EXPECT_EQ(result.messages, result.events + 60 * 5 * 2 + 60 * 5);
  EXPECT_GT(result.chunks, 2u);
  const int status = read_with_mcap_core(3);
  if (status == 77) GTEST_SKIP() << kNoReader;
  EXPECT_EQ(status, 0) << reader_says();

  // A file of which any bit differs is refused: the check can fail.
  std::fstream file(folder_ / "log.mcap", std::ios::in | std::ios::out | std::ios::binary);
  file.seekg(300'000);
  const int byte = file.get();
  file.seekp(300'000);
  file.put(static_cast<char>(byte ^ 1));
  file.close();
  EXPECT_NE(read_with_mcap_core(3), 0);
}

TEST_F(Mcap, TheReleasedLogsAreExported) {
  for (const fs::directory_entry& entry : fs::directory_iterator(VANTAGE_SOURCE_DIR "/tests/lcmtypes/released")) {
    if (entry.path().extension() != ".lcm") continue;
    log_ = entry.path();
    EXPECT_EQ(export_mcap(log_, folder_ / "log.mcap").faulty, 0u) << log_;
    const int status = read_with_mcap_core(1);
    if (status == 77) GTEST_SKIP() << kNoReader;
    EXPECT_EQ(status, 0) << log_ << reader_says();
  }
}

TEST_F(Mcap, EventsThatDoNotHoldAreCountedAndLeftOut) {
  {
    SampleLog log(log_);
    log.raw(kSampleStart, channel::kRobotState, "short");
    log.map(sample_map(1));
  }
  const McapExport result = export_mcap(log_, folder_ / "log.mcap");
  EXPECT_EQ(result.events, 2u);
  EXPECT_EQ(result.faulty, 1u);
  EXPECT_EQ(result.messages, 1u + 5);
}

}  // namespace
}  // namespace vantage
