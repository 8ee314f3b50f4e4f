// vantage-gain as a user runs it.

#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <sstream>

#include <gtest/gtest.h>

#include "offboard/gain/view_gain.h"
#include "offboard/mapping/octomap_io.h"
#include "tests/offboard/mapping/analytic_scene.h"

namespace vantage {
namespace {

struct Outcome {
  int status = -1;
  std::string out, err;
};

class GainProgram : public testing::Test {
 protected:
  GainProgram() {
    folder_ = std::filesystem::temp_directory_path() / ("vantage_gain_program_" + std::to_string(::getpid()) + "_" +
                                                        testing::UnitTest::GetInstance()->current_test_info()->name());
    std::filesystem::create_directories(folder_);
    OccupancyMap map(Region::cube({0, 0, 0.3}, 0.64, 0.02));
    for (const std::size_t i : {0U, 9U}) {
      EXPECT_TRUE(map.integrate(AnalyticScene{}.depth_map(vga_camera(), ring_views()[i])).ok);
    }
    write_map(folder_ / "map.ot", map);
    write_map(folder_ / "map.bt", map);
    std::ofstream views(folder_ / "views.txt");
    views.precision(17);
    for (const std::size_t i : {3U, 20U, 40U}) {
      const Eigen::Isometry3d pose = ring_views()[i];
      const Eigen::Quaterniond q(pose.linear());
      views << pose.translation().transpose() << " " << q.x() << " " << q.y() << " " << q.z() << " " << q.w() << "\n";
    }
  }
  ~GainProgram() override { std::filesystem::remove_all(folder_); }

  Outcome run(const std::string& arguments) {
    const std::string out = (folder_ / "out").string(), err = (folder_ / "err").string();
    const int raw =
        std::system((std::string(VANTAGE_GAIN_PROGRAM) + " " + arguments + " >" + out + " 2>" + err).c_str());
    const auto text = [](const std::string& path) {
      std::ifstream in(path);
      return std::string(std::istreambuf_iterator<char>(in), {});
    };
    return {WEXITSTATUS(raw), text(out), text(err)};
  }
  std::string in_folder(const std::string& name) { return (folder_ / name).string(); }
  std::string usual(const std::string& map) {
    return "--map " + in_folder(map) + " --views " + in_folder("views.txt") +
           " --camera 448,448,319.5,239.5,640,480 --rays 40x30";
  }

  std::filesystem::path folder_;
};

TEST_F(GainProgram, PrintsEveryFormulationOfEveryView) {
  const Outcome outcome = run(usual("map.ot"));
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  std::istringstream lines(outcome.out);
  std::string line;
  ASSERT_TRUE(std::getline(lines, line));
  EXPECT_EQ(line,
            "view,entropy,occlusion_aware,unobserved_voxel,rear_side_voxel,rear_side_entropy,proximity_count,combined,"
            "average_entropy,area_factor");
  const OccupancyMap map = read_map(folder_ / "map.ot");
  for (const std::size_t i : {3U, 20U, 40U}) {
    ASSERT_TRUE(std::getline(lines, line));
    const ViewGain gain = evaluate_view(map, RayBundle(vga_camera(), 40, 30), ring_views()[i]);
    std::istringstream cells(line);
    std::string cell;
    std::getline(cells, cell, ',');
    for (const Formulation formulation : kAllFormulations) {
      ASSERT_TRUE(std::getline(cells, cell, ','));
      EXPECT_NEAR(std::stod(cell), gain[formulation], 1e-3 * std::abs(gain[formulation]) + 1e-9)
          << name_of(formulation);
    }
  }
  EXPECT_FALSE(std::getline(lines, line));
}

TEST_F(GainProgram, SaysThatAForeignMapHasNoMarks) {
  const Outcome outcome = run(usual("map.bt"));
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_NE(outcome.err.find("no occlusion marks"), std::string::npos);
  EXPECT_NE(outcome.out.find("no-marks"), std::string::npos);
}

TEST_F(GainProgram, BadInputIsOneLineAndStatusTwo) {
  std::ofstream(folder_ / "cut.ot") << "# Octomap OcTree file\nid OcTree\nsize 5\nres 0.1\ndata\nxx";
  std::ofstream(folder_ / "bad.txt") << "0 0 zero 0 0 0 1\n";
  const std::string views = " --views " + in_folder("views.txt"), camera = " --camera 448,448,319.5,239.5,640,480";
  const std::vector<std::array<std::string, 2>> cases = {
      {"--map " + in_folder("none.ot") + views + camera, "none.ot"},
      {"--map " + in_folder("cut.ot") + views + camera, "cut short"},
      {"--map " + in_folder("map.ot") + " --views " + in_folder("bad.txt") + camera, "bad.txt"},
      {"--map " + in_folder("map.ot") + views + " --camera 448,448,319.5,239.5,0,480", "--camera"},
      {"--map " + in_folder("map.ot") + views + " --camera 448,448", "--camera"},
      {"--map " + in_folder("map.ot") + views + " --camera 448,448,nan,239.5,640,480", "principal"},
      {usual("map.ot") + " --rays 80", "--rays"},
      {usual("map.ot") + " --weights rear:1", "rear_side_voxel"},
      {usual("map.ot") + " --kernel fast", "portable"},
      {usual("map.ot") + " --threads 0", "threads"}};
  for (const auto& [arguments, part] : cases) {
    const Outcome outcome = run(arguments);
    EXPECT_EQ(outcome.status, 2) << arguments;
    EXPECT_NE(outcome.err.find(part), std::string::npos) << arguments << "\n" << outcome.err;
    EXPECT_EQ(outcome.out, "");
  }
  EXPECT_EQ(run("--no-such-option").status, 2);
}

}  // namespace
}  // namespace vantage
