#include <filesystem>
#include <fstream>
#include <limits>
#include <random>

#include <gtest/gtest.h>

#include "calib/files/atomic_file.h"
#include "calib/files/ply.h"
#include "calib/files/trajectory.h"
#include "tests/input_fault.h"

namespace vantage {
namespace {

namespace fs = std::filesystem;

class Files : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(testing::TempDir()) / testing::UnitTest::GetInstance()->current_test_info()->name();
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  fs::path write(const std::string& name, const std::string& text) {
    std::ofstream(folder_ / name) << text;
    return folder_ / name;
  }
  fs::path folder_;
};

TEST_F(Files, AtomicFileAppearsWholeOrNotAtAll) {
  {
    AtomicFile file(folder_ / "a");
    file.stream() << "half";
    EXPECT_FALSE(fs::exists(folder_ / "a"));
  }
  EXPECT_TRUE(fs::is_empty(folder_));
  AtomicFile file(folder_ / "a");
  file.stream() << "whole";
  file.commit();
  std::string text;
  std::ifstream(folder_ / "a") >> text;
  EXPECT_EQ(text, "whole");
  EXPECT_NE(input_fault([&] { AtomicFile(folder_ / "none" / "a"); }).find("none/a: can't be written"),
            std::string::npos);
}

TEST_F(Files, PlyIsReadBackToTheSameBits) {
  const unsigned seed = 3;
  RecordProperty("seed", static_cast<int>(seed));
  std::mt19937 random(seed);
  std::normal_distribution<float> normal;
  PlyModel model;
  for (int i = 0; i < 100; ++i) {
    model.points.emplace_back(normal(random), normal(random), normal(random));
    model.normals.emplace_back(normal(random), normal(random), normal(random));
    model.triangles.push_back({static_cast<std::uint32_t>(i), 0, 99});
  }
  write_ply(folder_ / "m.ply", model);
  const PlyModel again = read_ply(folder_ / "m.ply");
  EXPECT_EQ(again.points, model.points);
  EXPECT_EQ(again.normals, model.normals);
  EXPECT_EQ(again.triangles, model.triangles);
}

TEST_F(Files, PlyReadsAsciiAndPassesOverOtherProperties) {
  const PlyModel model = read_ply(write("a.ply",
                                        "ply\nformat ascii 1.0\ncomment hello\nelement vertex 3\nproperty double x\n"
                                        "property double y\nproperty double z\nproperty uchar red\n"
                                        "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
                                        "0 0 0 255\n1 0 0 255\n0 1.5 0 9\n3 0 1 2\n"));
  ASSERT_EQ(model.points.size(), 3u);
  EXPECT_EQ(model.points[2], Eigen::Vector3f(0, 1.5, 0));
  ASSERT_EQ(model.triangles.size(), 1u);
  EXPECT_EQ(model.triangles[0][2], 2u);
}

TEST_F(Files, PlyFaultsAreNamed) {
  const std::string head = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n";
  EXPECT_NE(input_fault([&] { read_ply(folder_ / "none.ply"); }).find("none.ply: no such file"), std::string::npos);
  EXPECT_NE(input_fault([&] { read_ply(write("b", "obj\n")); }).find("not a PLY file"), std::string::npos);
  EXPECT_NE(input_fault([&] { read_ply(write("b", head + "end_header\n0 0\n")); }).find("lack x, y or z"),
            std::string::npos);
  EXPECT_NE(input_fault([&] { read_ply(write("b", head + "property float z\nend_header\n0 0\n")); }).find("cut short"),
            std::string::npos);
  EXPECT_NE(input_fault([&] { read_ply(write("b", head)); }).find("ends before end_header"), std::string::npos);
  EXPECT_NE(input_fault([&] {
              read_ply(write("b", head + "property float z\nelement face 1\nproperty list uchar int i\nend_header\n"
                                         "0 0 0\n3 0 0 7\n"));
            }).find("names a vertex that is not there"),
            std::string::npos);
  // A header that claims more than the file holds is found by reading, not by allocating.
  EXPECT_NE(input_fault([&] {
              read_ply(write("b",
                             "ply\nformat ascii 1.0\nelement vertex 99999999999\nproperty float x\n"
                             "property float y\nproperty float z\nend_header\n0 0 0\n"));
            }).find("cut short"),
            std::string::npos);
}

TEST_F(Files, TrajectoryRoundTrips) {
  std::vector<StampedPose> poses(2);
  poses[1].time_s = 0.5;
  poses[1].T_world_camera =
      Eigen::Translation3d(1, -2, 3) * Eigen::AngleAxisd(1.2, Eigen::Vector3d(1, 2, 3).normalized());
  write_tum_trajectory(folder_ / "t.txt", poses);
  const auto again = read_tum_trajectory(folder_ / "t.txt");
  ASSERT_EQ(again.size(), 2u);
  EXPECT_EQ(again[1].time_s, 0.5);
  EXPECT_TRUE(again[1].T_world_camera.isApprox(poses[1].T_world_camera, 1e-8));
}

TEST_F(Files, TrajectoryFaultsNameTheLine) {
  const auto message = [&](const std::string& text) {
    return input_fault([&] { read_tum_trajectory(write("t.txt", text)); });
  };
  const std::string good = "# comment\n0 0 0 0 0 0 0 1\n";
  EXPECT_NE(message(good + "1 nan 0 0 0 0 0 1\n").find("t.txt:3: the number nan is not finite"), std::string::npos);
  EXPECT_NE(message(good + "1 0 0 0 0 0 0\n").find("t.txt:3: expected \"timestamp"), std::string::npos);
  EXPECT_NE(message(good + "1 0 0 0 0 0 0 2\n").find("unit length"), std::string::npos);
  EXPECT_NE(message(good + "0 0 0 0 0 0 0 1\n").find("does not rise"), std::string::npos);
  EXPECT_NE(message(good + "1 x 0 0 0 0 0 1\n").find("expected a number, found \"x\""), std::string::npos);
}

TEST_F(Files, MatrixPoseMustBeRigid) {
  const Eigen::Isometry3d pose = read_matrix_pose(write("p.txt", "0 -1 0 4\n1 0 0 5\n0 0 1 6\n0 0 0 1\n"));
  EXPECT_TRUE((pose * Eigen::Vector3d(1, 0, 0)).isApprox(Eigen::Vector3d(4, 6, 6)));
  EXPECT_NE(input_fault([&] { read_matrix_pose(write("p.txt", "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0")); }).find("15 numbers"),
            std::string::npos);
  EXPECT_NE(
      input_fault([&] { read_matrix_pose(write("p.txt", "2 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1")); }).find("not a rigid"),
      std::string::npos);
}

}  // namespace
}  // namespace vantage
