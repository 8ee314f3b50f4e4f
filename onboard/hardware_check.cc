#include "onboard/hardware_check.h"

#include <chrono>
#include <cmath>
#include <cstdio>
#include <memory>
#include <string_view>

#include "calib/files/input_error.h"
#include "drivers/camera/image_folder.h"
#include "drivers/camera/v4l2_camera.h"
#include "drivers/can/open_can_bus.h"
#include "drivers/robot/robot_drives.h"
#include "lcmtypes/link/clock.h"

namespace vantage {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr std::string_view kV4l2 = "v4l2:", kImages = "images:";
constexpr int kFrames = 30;
constexpr seconds kPatience{5};
constexpr int kCycles = 100;

int fault(const std::string& text) {
  std::printf("fault: %s\n", text.c_str());
  return kExitFailure;
}

bool take_frames(FrameSource& source, int count, Frame* frame) {
  for (int i = 0; i < count; ++i) {
    if (source.next(frame, kPatience) != FrameStatus::kFrame) return false;
  }
  return true;
}

int check_v4l2(const Rig& rig, const std::string& device) {
  V4l2Camera camera(v4l2_options(rig, device));
  Frame first, last;
  if (!take_frames(camera, 1, &first) || !take_frames(camera, kFrames, &last)) {
    return fault(device + ": " + (camera.end_reason().empty() ? "no frame came in 5 s" : camera.end_reason()));
  }
  const double rate = static_cast<double>(last.sequence - first.sequence) /
                      (static_cast<double>(last.capture_time_ns - first.capture_time_ns) * 1e-9);
  const V4l2Stream& stream = *camera.stream();
  const CameraCounters& counters = camera.counters();
  std::printf("camera %s: %s, %d x %d %s, %.2f Hz of %.2f; %s\n", device.c_str(), stream.identity().card.c_str(),
              stream.width(), stream.height(), fourcc_text(stream.fourcc()).c_str(), rate, stream.rate_hz(),
              camera.clock().text().c_str());
  std::printf(
      "  %llu frames, %llu copied, %llu dropped, %llu faulty, %llu late; exposure %.4f s, gain %d, white %d K\n",
      static_cast<unsigned long long>(counters.delivered), static_cast<unsigned long long>(counters.copied),
      static_cast<unsigned long long>(counters.dropped), static_cast<unsigned long long>(counters.faulty),
      static_cast<unsigned long long>(counters.late), last.exposure_s, last.gain, last.white_balance_k);
  for (const std::string& note : stream.settings().notes) std::printf("  %s\n", note.c_str());
  return kExitOk;
}

int check_images(const Rig& rig, const std::string& folder) {
  ImageFolder images({folder, rig.capture.rate_hz, false});
  Frame frame;
  while (take_frames(images, 1, &frame)) {
    if (frame.image.width == rig.camera.width && frame.image.height == rig.camera.height) continue;
    return fault(folder + ": image " + std::to_string(frame.sequence) + " is " + std::to_string(frame.image.width) +
                 " x " + std::to_string(frame.image.height) + ", the rig's camera " + std::to_string(rig.camera.width) +
                 " x " + std::to_string(rig.camera.height));
  }
  if (frame.sequence != images.size()) return fault(images.end_reason());
  std::printf("camera %s: %zu images, %d x %d\n", folder.c_str(), images.size(), frame.image.width, frame.image.height);
  return kExitOk;
}

int check_camera(const Rig& rig, const std::string& camera) {
  if (camera.starts_with(kV4l2)) return check_v4l2(rig, camera.substr(kV4l2.size()));
  if (camera.starts_with(kImages)) return check_images(rig, camera.substr(kImages.size()));
  throw InputError("--camera " + camera + ": --check takes v4l2:DEVICE or images:FOLDER");
}

int check_drives(const Rig& rig, const std::string& rig_path, const std::string& can) {
  if (!rig.drives) throw InputError(rig_path + ": describes no drives; --can has nothing to look for");
  const SystemClock clock;
  const std::unique_ptr<can::CanBus> bus = can::open_can_bus(can);
  RobotDrives robot(*bus, clock, *rig.drives);
  const auto begin = clock.monotonic();
  if (const std::string why = robot.set_up(); !why.empty()) return fault(why);
  const double set_up_s = std::chrono::duration<double>(clock.monotonic() - begin).count();
  robot.clear_punctuality();
  for (int i = 0; i < kCycles; ++i) robot.cycle({});
  if (!robot.fault_text().empty()) return fault(robot.fault_text());
  const RobotState& state = robot.state();
  std::printf("%s: %zu drives set up and read back in %.2f s, none has power\n", can.c_str(), state.axes, set_up_s);
  for (std::size_t i = 0; i < state.axes; ++i) {
    std::printf("  %s (node %d): %s, at %.4f rad of its encoder's own zero\n", robot.axis_name(i).c_str(),
                robot.node(i), to_text(state.axis[i].drive), robot.encoder_angle_rad(i));
  }
  std::printf("  %s\n", to_text(robot.punctuality()).c_str());
  return kExitOk;
}

}  // namespace

V4l2CameraOptions v4l2_options(const Rig& rig, const std::string& device) {
  V4l2CameraOptions options;
  options.device = device;
  options.stream.width = rig.camera.width;
  options.stream.height = rig.camera.height;
  options.stream.rate_hz = rig.capture.rate_hz;
  options.stream.settings = {rig.capture.exposure_s, rig.capture.gain, rig.capture.white_balance_k};
  return options;
}

int list_cameras() {
  const std::vector<CameraDescription> cameras = find_cameras();
  for (const CameraDescription& camera : cameras) std::printf("%s", to_text(camera).c_str());
  if (cameras.empty()) std::printf("no camera is connected\n");
  return kExitOk;
}

int check_hardware(const Rig& rig, const std::string& rig_path, const std::string& camera, const std::string& can) {
  int status = kExitOk;
  if (!camera.empty()) status = check_camera(rig, camera);
  if (!can.empty()) status = std::max(status, check_drives(rig, rig_path, can));
  return status;
}

}  // namespace vantage
