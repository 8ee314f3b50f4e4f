#include "drivers/sim/snapshot.h"

#include <stdexcept>
#include <vector>

#include <opencv2/imgcodecs.hpp>

#include "calib/files/atomic_file.h"
#include "calib/files/input_error.h"

namespace vantage::sim {

void write_image(const std::filesystem::path& path, int width, int height, std::span<const std::uint8_t> grey) {
  if (grey.size() != static_cast<std::size_t>(width) * static_cast<std::size_t>(height)) {
    throw std::invalid_argument("write_image: as many bytes as pixels are needed");
  }
  // OpenCV only reads the pixels, though its header for them knows no const.
  const cv::Mat image(height, width, CV_8UC1, const_cast<std::uint8_t*>(grey.data()));
  std::vector<std::uint8_t> encoded;
  try {
    if (!cv::imencode(path.extension().string(), image, encoded)) encoded.clear();
  } catch (const cv::Exception&) {
    encoded.clear();
  }
  if (encoded.empty()) throw InputError(path.string() + ": can't be encoded as an image; name it .png");
  AtomicFile file(path);
  file.stream().write(reinterpret_cast<const char*>(encoded.data()), static_cast<std::streamsize>(encoded.size()));
  file.commit();
}

}  // namespace vantage::sim
