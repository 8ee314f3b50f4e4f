#include "drivers/camera/image_folder.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <optional>
#include <thread>

#include <opencv2/imgcodecs.hpp>

#include "calib/files/input_error.h"

namespace vantage {
namespace {

namespace fs = std::filesystem;
using std::chrono::nanoseconds;
using std::chrono::steady_clock;

constexpr std::size_t kDigitsOfTime = 16;  // nanoseconds since 1970 have 19

bool is_image(const fs::path& path) {
  constexpr std::array kEndings{".png", ".jpg", ".jpeg", ".pgm", ".bmp", ".tif", ".tiff"};
  std::string ending = path.extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return std::find(kEndings.begin(), kEndings.end(), ending) != kEndings.end();
}

std::optional<std::int64_t> stamp_of(const fs::path& path) {
  const std::string name = path.stem().string();
  std::int64_t stamp = 0;
  const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), stamp);
  if (name.size() < kDigitsOfTime || error != std::errc() || end != name.data() + name.size()) return {};
  return stamp;
}

}  // namespace

ImageFolder::ImageFolder(const ImageFolderOptions& options) : options_(options) {
  const std::string name = options.folder.string();
  if (!(options.rate_hz > 0)) throw InputError(name + ": the frame rate must be positive");
  std::error_code error;
  std::vector<fs::path> paths;
  for (const fs::directory_entry& entry : fs::directory_iterator(options.folder, error)) {
    if (entry.is_regular_file() && is_image(entry.path())) paths.push_back(entry.path());
  }
  if (error) throw InputError(name + ": no such folder, or it can't be read");
  if (paths.empty()) throw InputError(name + ": holds no image (PNG, JPEG, PGM, BMP or TIFF)");
  std::sort(paths.begin(), paths.end());
  const bool stamped = std::all_of(paths.begin(), paths.end(), [](const fs::path& path) { return stamp_of(path); });
  const std::int64_t first = stamped ? *stamp_of(paths.front()) : 0;
  for (std::size_t i = 0; i < paths.size(); ++i) {
    const auto time = stamped ? *stamp_of(paths[i]) - first
                              : static_cast<std::int64_t>(static_cast<double>(i) * 1e9 / options.rate_hz);
    images_.push_back({paths[i], nanoseconds(time)});
  }
}

FrameStatus ImageFolder::next(Frame* frame, std::chrono::milliseconds timeout) {
  if (!end_reason_.empty()) return FrameStatus::kEnded;
  if (next_ == images_.size()) {
    end_reason_ = options_.folder.string() + ": all " + std::to_string(images_.size()) + " images were shown";
    return FrameStatus::kEnded;
  }
  if (next_ == 0) start_ = steady_clock::now();
  const Image& image = images_[next_];
  const steady_clock::time_point due = start_ + image.time;
  if (options_.in_real_time) {
    const auto deadline = steady_clock::now() + timeout;
    std::this_thread::sleep_until(std::min(due, deadline));
    if (due > deadline) return FrameStatus::kTimeout;
  }
  const auto picture = std::make_shared<cv::Mat>(cv::imread(image.path.string(), cv::IMREAD_GRAYSCALE));
  if (picture->empty()) {
    end_reason_ = image.path.string() + ": can't be read as an image";
    return FrameStatus::kEnded;
  }
  ++next_;
  *frame = {};
  frame->capture_time_ns = nanoseconds(due.time_since_epoch()).count();
  frame->sequence = next_;
  frame->image = {picture->cols, picture->rows, static_cast<std::ptrdiff_t>(picture->step[0]),
                  std::shared_ptr<const std::uint8_t>(picture, picture->data)};
  return FrameStatus::kFrame;
}

}  // namespace vantage
