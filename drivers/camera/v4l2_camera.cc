#include "drivers/camera/v4l2_camera.h"

#include <algorithm>
#include <mutex>
#include <stdexcept>
#include <utility>
#include <vector>

#include <poll.h>
#include <sys/eventfd.h>

#include "calib/files/input_error.h"

namespace vantage {
namespace {

using std::chrono::milliseconds;
using std::chrono::nanoseconds;
using std::chrono::steady_clock;

constexpr milliseconds kLookAgain{50};  // for a device that has gone
constexpr int kLeastQueued = 2;         // buffers that the driver is never left without
constexpr std::size_t kMostPictures = 8;
constexpr int kMostRestarts = 3;  // without a frame in between: then the device is opened anew

}  // namespace

bool V4l2CameraOptions::valid(std::string* why) const {
  const auto refuse = [why](const char* reason) {
    if (why != nullptr) *why = reason;
    return false;
  };
  if (device.empty()) return refuse("no device is named");
  if (stream.width <= 0 || stream.height <= 0) return refuse("the size must be positive");
  if (!(stream.rate_hz > 0)) return refuse("the frame rate must be positive");
  if (!stream.format.empty() && stream.format.size() > 4) return refuse("a format has four characters");
  if (watchdog <= milliseconds(0)) return refuse("the watchdog's time must be positive");
  return true;
}

/// Memory for converted pictures, used again when the last copy of a frame has gone.
class V4l2Camera::PicturePool : public std::enable_shared_from_this<PicturePool> {
 public:
  explicit PicturePool(std::size_t bytes) : bytes_(bytes) {}

  /// Null when all are held.
  std::shared_ptr<std::uint8_t> picture() {
    const std::lock_guard lock(mutex_);
    if (free_.empty() && made_ < kMostPictures) {
      free_.push_back(std::make_unique<std::uint8_t[]>(bytes_));
      ++made_;
    }
    if (free_.empty()) return nullptr;
    std::uint8_t* const memory = free_.back().release();
    free_.pop_back();
    return {memory, [pool = shared_from_this()](std::uint8_t* back) {
              const std::lock_guard back_lock(pool->mutex_);
              pool->free_.emplace_back(back);
            }};
  }
  std::size_t bytes() const { return bytes_; }

 private:
  std::size_t bytes_;
  std::mutex mutex_;  // guards both below
  std::vector<std::unique_ptr<std::uint8_t[]>> free_;
  std::size_t made_ = 0;
};

V4l2Camera::V4l2Camera(const V4l2CameraOptions& options)
    : options_(options),
      stop_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)),
      clock_(nanoseconds(0)),
      last_frame_(steady_clock::now()) {
  std::string why;
  if (!options.valid(&why)) throw std::invalid_argument("V4l2Camera: " + why);
  stream_ = V4l2Stream::open(options.device, options.stream, &why);
  if (stream_ == nullptr) throw InputError(why);
  identity_ = stream_->identity();
  pool_ = std::make_shared<PicturePool>(static_cast<std::size_t>(options.stream.width) *
                                        static_cast<std::size_t>(options.stream.height));
  clock_ = CaptureClock(nanoseconds(static_cast<std::int64_t>(1e9 / stream_->rate_hz())));
}

V4l2Camera::~V4l2Camera() {
  if (stream_ != nullptr) stream_->close();
}

void V4l2Camera::stop() { ::eventfd_write(stop_.get(), 1); }

FrameStatus V4l2Camera::end(const std::string& reason) {
  if (end_reason_.empty()) end_reason_ = reason;
  if (stream_ != nullptr) stream_->close();
  return FrameStatus::kEnded;
}

V4l2Camera::Wait V4l2Camera::wait(steady_clock::time_point until) const {
  pollfd polled[2] = {{stop_.get(), POLLIN, 0}, {stream_ != nullptr ? stream_->fd() : -1, POLLIN, 0}};
  const auto left = std::chrono::ceil<milliseconds>(until - steady_clock::now());
  const int ready = ::poll(polled, 2, static_cast<int>(std::max(left, milliseconds(0)).count()));
  if (ready > 0 && (polled[0].revents & POLLIN) != 0) return Wait::kStopped;
  return ready > 0 ? Wait::kReadable : Wait::kTimeout;
}

FrameStatus V4l2Camera::next(Frame* frame, milliseconds timeout) {
  const auto deadline = steady_clock::now() + timeout;
  while (end_reason_.empty()) {
    if (stream_ == nullptr && !reopen()) {
      if (wait(std::min(deadline, steady_clock::now() + kLookAgain)) == Wait::kStopped) return end("stopped");
      if (steady_clock::now() >= deadline) return FrameStatus::kTimeout;
      continue;
    }
    const auto watchdog = last_frame_ + options_.watchdog;
    switch (wait(std::min(deadline, watchdog))) {
      case Wait::kStopped:
        return end("stopped");
      case Wait::kReadable: {
        const FrameStatus status = take(frame);
        if (status != FrameStatus::kTimeout) return status;
        break;
      }
      case Wait::kTimeout:
        if (steady_clock::now() >= watchdog) restart_stream();
        break;
    }
    if (steady_clock::now() >= deadline) return FrameStatus::kTimeout;
  }
  return FrameStatus::kEnded;
}

bool V4l2Camera::reopen() {
  const std::filesystem::path node = find_node(options_.device, identity_);
  if (node.empty()) return false;
  std::string ignored;  // it may be half there: tried again soon
  stream_ = V4l2Stream::open(node, options_.stream, &ignored);
  if (stream_ == nullptr) return false;
  ++counters_.reopened;
  restarts_in_a_row_ = 0;
  last_frame_ = steady_clock::now();
  clock_ = CaptureClock(nanoseconds(static_cast<std::int64_t>(1e9 / stream_->rate_hz())));
  return true;
}

void V4l2Camera::lose_device() {
  stream_->close();
  stream_.reset();
  last_sequence_.reset();
}

void V4l2Camera::restart_stream() {
  ++counters_.restarts;
  last_sequence_.reset();
  last_frame_ = steady_clock::now();
  if (++restarts_in_a_row_ > kMostRestarts || !stream_->restart()) lose_device();
}

FrameStatus V4l2Camera::take(Frame* frame) {
  std::optional<V4l2Stream::Buffer> newest;
  V4l2Stream::Buffer buffer;
  while (true) {
    const V4l2Stream::Take taken = stream_->take(&buffer);
    if (taken == V4l2Stream::Take::kFrame) {
      count_gap(buffer.sequence);
      if (newest) {
        ++counters_.late;
        stream_->give_back(newest->index);
      }
      newest = buffer;
      if (options_.newest_only) continue;
      break;
    }
    if (taken == V4l2Stream::Take::kFaulty) {
      count_gap(buffer.sequence);
      ++counters_.faulty;
      continue;
    }
    if (taken == V4l2Stream::Take::kNothing || newest) break;
    taken == V4l2Stream::Take::kGone ? lose_device() : restart_stream();
    return FrameStatus::kTimeout;
  }
  if (!newest) return FrameStatus::kTimeout;
  last_frame_ = steady_clock::now();
  restarts_in_a_row_ = 0;
  if (deliver(*newest, frame)) return FrameStatus::kFrame;
  if (clock_.verdict() == CaptureClock::Verdict::kRefused) {
    return end(options_.device.string() + ": " + clock_.text());
  }
  return FrameStatus::kTimeout;
}

void V4l2Camera::count_gap(std::uint32_t sequence) {
  // Some drivers do not begin at 0; the first number of a stream says nothing.
  const std::uint32_t step = last_sequence_ ? sequence - *last_sequence_ : 1;
  last_sequence_ = sequence;
  if (step > 1) counters_.dropped += step - 1;
  sequence_ += step;
}

bool V4l2Camera::deliver(const V4l2Stream::Buffer& buffer, Frame* frame) {
  const nanoseconds now = steady_clock::now().time_since_epoch();
  const std::optional<nanoseconds> time = clock_.capture_time(buffer.stamp, now);
  if (!time) {
    if (clock_.verdict() == CaptureClock::Verdict::kGood || clock_.verdict() == CaptureClock::Verdict::kCorrected) {
      ++counters_.faulty;
    }
    stream_->give_back(buffer.index);
    return false;
  }
  const int width = stream_->width(), height = stream_->height();
  GreyImage image{width, height, width, nullptr};
  if (is_grey_in_place(stream_->format()) && stream_->queued() >= kLeastQueued) {
    image.stride = static_cast<std::ptrdiff_t>(stream_->bytes_per_line());
    image.pixels = {buffer.bytes.data(),
                    [stream = stream_, index = buffer.index](const std::uint8_t*) { stream->give_back(index); }};
  } else {
    const std::shared_ptr<std::uint8_t> picture = pool_->picture();
    const bool converted =
        picture != nullptr && to_grey(stream_->format(), {buffer.bytes, width, height, stream_->bytes_per_line()},
                                      {picture.get(), pool_->bytes()});
    stream_->give_back(buffer.index);
    if (!converted) {
      ++(picture == nullptr ? counters_.starved : counters_.faulty);
      return false;
    }
    ++counters_.copied;
    image.pixels = picture;
  }
  const FixedSettings& settings = stream_->settings();
  const auto half_exposure = nanoseconds(static_cast<std::int64_t>(5e8 * settings.exposure_s));
  *frame = {};
  frame->capture_time_ns = (*time + (buffer.stamp_at_start ? half_exposure : -half_exposure)).count();
  frame->sequence = sequence_;
  frame->exposure_s = settings.exposure_s;
  frame->gain = settings.gain;
  frame->white_balance_k = settings.white_balance_k;
  frame->image = std::move(image);
  ++counters_.delivered;
  return true;
}

}  // namespace vantage
