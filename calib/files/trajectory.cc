#include "calib/files/trajectory.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <iomanip>
#include <iterator>
#include <limits>
#include <sstream>

#include <Eigen/SVD>

#include "calib/files/atomic_file.h"
#include "calib/files/input_error.h"

namespace vantage {
namespace {

constexpr double kUnitTolerance = 1e-2;  // recordings print four decimals

/// A text file's lines without comments and empty ones; each fault names the line.
class Lines {
 public:
  explicit Lines(const std::filesystem::path& path) : path_(path), in_(path) {
    if (!in_) throw InputError(path.string() + ": no such file, or it can't be read");
  }

  /// The words of the next line that has any.
  bool next(std::vector<std::string>* words) {
    for (std::string line; std::getline(in_, line);) {
      ++number_;
      std::istringstream stream(line.substr(0, line.find('#')));
      words->assign(std::istream_iterator<std::string>(stream), {});
      if (!words->empty()) return true;
    }
    return false;
  }

  [[noreturn]] void fail(const std::string& fault) const {
    throw InputError(path_.string() + ":" + std::to_string(number_) + ": " + fault);
  }

  double number(const std::string& word) const {
    double value = 0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (error != std::errc() || end != word.data() + word.size()) fail("expected a number, found \"" + word + "\"");
    if (!std::isfinite(value)) fail("the number " + word + " is not finite");
    return value;
  }

  /// x y z qx qy qz qw from words[first] on.
  Eigen::Isometry3d pose(const std::vector<std::string>& words, std::size_t first) const {
    double v[7];
    for (std::size_t i = 0; i < 7; ++i) v[i] = number(words[first + i]);
    const Eigen::Quaterniond rotation(v[6], v[3], v[4], v[5]);
    if (std::abs(rotation.norm() - 1) > kUnitTolerance) {
      fail("the quaternion is not of unit length (its norm is " + std::to_string(rotation.norm()) + ")");
    }
    return Eigen::Translation3d(v[0], v[1], v[2]) * rotation.normalized();
  }

 private:
  const std::filesystem::path& path_;
  std::ifstream in_;
  int number_ = 0;
};

}  // namespace

std::vector<StampedPose> read_tum_trajectory(const std::filesystem::path& path) {
  Lines lines(path);
  std::vector<StampedPose> trajectory;
  for (std::vector<std::string> words; lines.next(&words);) {
    if (words.size() != 8) lines.fail("expected \"timestamp tx ty tz qx qy qz qw\"");
    StampedPose entry{lines.number(words[0]), lines.pose(words, 1)};
    if (!trajectory.empty() && entry.time_s <= trajectory.back().time_s) lines.fail("the time does not rise");
    trajectory.push_back(std::move(entry));
  }
  return trajectory;
}

const StampedPose* nearest_pose(const std::vector<StampedPose>& trajectory, double time_s, double largest_gap_s) {
  const auto after = std::lower_bound(trajectory.begin(), trajectory.end(), time_s,
                                      [](const StampedPose& pose, double sought_s) { return pose.time_s < sought_s; });
  const StampedPose* nearest = nullptr;
  for (const auto candidate : {after, after == trajectory.begin() ? after : after - 1}) {
    if (candidate == trajectory.end()) continue;
    if (nearest == nullptr || std::abs(candidate->time_s - time_s) < std::abs(nearest->time_s - time_s)) {
      nearest = &*candidate;
    }
  }
  return nearest != nullptr && std::abs(nearest->time_s - time_s) <= largest_gap_s ? nearest : nullptr;
}

void write_tum_trajectory(const std::filesystem::path& path, const std::vector<StampedPose>& trajectory) {
  AtomicFile file(path);
  std::ostream& out = file.stream();
  out << "# timestamp tx ty tz qx qy qz qw (T_world_camera)\n";
  for (const StampedPose& entry : trajectory) {
    const Eigen::Quaterniond q(entry.T_world_camera.linear());
    const Eigen::Vector3d t = entry.T_world_camera.translation();
    out << std::fixed << std::setprecision(6) << entry.time_s << std::setprecision(9) << ' ' << t.x() << ' ' << t.y()
        << ' ' << t.z() << ' ' << q.x() << ' ' << q.y() << ' ' << q.z() << ' ' << q.w() << '\n';
  }
  file.commit();
}

Eigen::Isometry3d read_matrix_pose(const std::filesystem::path& path) {
  Lines lines(path);
  std::vector<double> values;
  for (std::vector<std::string> words; lines.next(&words);) {
    for (const std::string& word : words) values.push_back(lines.number(word));
  }
  if (values.size() != 16) lines.fail("expected a 4 x 4 matrix, found " + std::to_string(values.size()) + " numbers");
  const Eigen::Matrix4d matrix = Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(values.data());
  const Eigen::Matrix3d rotation = matrix.topLeftCorner<3, 3>();
  const double skew = (rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (skew > kUnitTolerance || rotation.determinant() < 0 || matrix.row(3) != Eigen::RowVector4d(0, 0, 0, 1)) {
    lines.fail("the matrix is not a rigid motion (rotation and translation, last row 0 0 0 1)");
  }
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(rotation, Eigen::ComputeFullU | Eigen::ComputeFullV);
  pose.linear() = svd.matrixU() * svd.matrixV().transpose();
  pose.translation() = matrix.topRightCorner<3, 1>();
  return pose;
}

std::vector<Eigen::Isometry3d> read_pose_list(const std::filesystem::path& path) {
  Lines lines(path);
  std::vector<Eigen::Isometry3d> poses;
  for (std::vector<std::string> words; lines.next(&words);) {
    if (words.size() != 7) lines.fail("expected \"x y z qx qy qz qw\"");
    poses.push_back(lines.pose(words, 0));
  }
  return poses;
}

std::vector<StampedFile> read_file_list(const std::filesystem::path& path) {
  Lines lines(path);
  std::vector<StampedFile> files;
  for (std::vector<std::string> words; lines.next(&words);) {
    if (words.size() != 2) lines.fail("expected \"timestamp file\"");
    files.push_back({lines.number(words[0]), path.parent_path() / words[1]});
  }
  return files;
}

}  // namespace vantage
