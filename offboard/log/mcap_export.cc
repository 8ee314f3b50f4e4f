#include "offboard/log/mcap_export.h"

#include <algorithm>
#include <limits>
#include <map>
#include <string>

#include "calib/files/atomic_file.h"
#include "offboard/log/depth_map_gatherer.h"
#include "offboard/log/foxglove_messages.h"
#include "offboard/log/known_channels.h"
#include "offboard/log/log_scan.h"
#include "offboard/log/mcap_writer.h"
#include "offboard/log/message_json.h"
#include "offboard/log/message_pose.h"

namespace vantage {
namespace {

constexpr const char* kWorld = "world";
constexpr const char* kCamera = "camera";             // where the robot says it is
constexpr const char* kDepthCamera = "depth_camera";  // where a depth map was taken

/// MCAP has no time before 1970, and the last one here is in 2262; a log of such events is damaged or made up.
std::uint64_t nanoseconds(std::int64_t utime) {
  constexpr std::int64_t kLast = std::numeric_limits<std::int64_t>::max() / 1000;
  return static_cast<std::uint64_t>(std::clamp<std::int64_t>(utime, 0, kLast)) * 1000;
}

class Exporter {
 public:
  explicit Exporter(std::ostream& out) : mcap_(out, "vantage") {}

  /// False when the event is of ours and does not hold.
  bool add(const LogEvent& event) {
    event_ = &event;
    const ChannelSchema* schema = find_channel(event.channel);
    if (schema == nullptr) {
      // Nobody knows its type: its bytes as they are, and no schema.
      write(event.channel, "", "lcm", event.utime,
            {reinterpret_cast<const char*>(event.bytes.data()), event.bytes.size()});
      return true;
    }
    std::string fault;
    const std::optional<MessageFields> message = MessageFields::read(*schema, event.bytes, &fault);
    if (!message) return false;
    const std::int64_t sent = message->find("utime")->integer();
    write(event.channel, "vantage." + std::string(schema->type), "json", sent, message_json(*schema, *message));
    if (schema->type == "robot_state_t") add_pose("/robot/pose", sent, *message, true);
    if (schema->type == "motion_goal_t") add_pose("/planner/goal", sent, *message, false);
    if (schema->type == "preview_t") {
      write("/preview", "foxglove.CompressedImage", "json", sent,
            foxglove_jpeg(sent, kCamera, message->find("jpeg")->bytes));
    }
    if (const auto map = maps_.take(event, *message, "", &fault)) add_depth_map(*map);
    return fault.empty();
  }

  McapWriter& mcap() { return mcap_; }

 private:
  void add_pose(const char* topic, std::int64_t utime, const MessageFields& message, bool moves_camera) {
    const std::optional<Eigen::Isometry3d> pose = pose_in(message);
    if (!pose) return;
    write(topic, "foxglove.PoseInFrame", "json", utime, foxglove_pose(utime, kWorld, *pose));
    if (!moves_camera) return;
    write("/tf", "foxglove.FrameTransform", "json", utime, foxglove_transform(utime, kWorld, kCamera, *pose));
  }

  void add_depth_map(const DepthMap& map) {
    const auto put = [&](const char* topic, const char* type, const std::string& json) {
      write(topic, type, "json", map.utime, json);
    };
    put("/tf", "foxglove.FrameTransform", foxglove_transform(map.utime, kWorld, kDepthCamera, map.T_world_camera));
    put("/depth/calibration", "foxglove.CameraCalibration", foxglove_calibration(map.utime, kDepthCamera, map.camera));
    put("/depth/image", "foxglove.RawImage", foxglove_depth_image(kDepthCamera, map));
    put("/depth/sigma", "foxglove.RawImage", foxglove_sigma_image(kDepthCamera, map));
    put("/depth/state", "foxglove.RawImage", foxglove_state_image(kDepthCamera, map));
  }

  void write(const std::string& topic, const std::string& type, const char* encoding, std::int64_t sent,
             std::string_view data) {
    auto channel = channels_.find(topic);
    if (channel == channels_.end())
      channel = channels_.emplace(topic, mcap_.add_channel(schema_of(topic, type), topic, encoding)).first;
    mcap_.write(channel->second, static_cast<std::uint32_t>(event_->number), nanoseconds(event_->utime),
                nanoseconds(sent), {reinterpret_cast<const std::uint8_t*>(data.data()), data.size()});
  }

  /// Two versions of a type are two schemas of one name.
  McapWriter::SchemaId schema_of(const std::string& topic, const std::string& type) {
    if (type.empty()) return 0;
    const bool foxglove = type.starts_with("foxglove.");
    const std::string text = foxglove ? foxglove_schema(type) : json_schema(*find_channel(topic));
    const auto known = schemas_.find(text);
    if (known != schemas_.end()) return known->second;
    return schemas_[text] = mcap_.add_schema(type, "jsonschema", text);
  }

  McapWriter mcap_;
  DepthMapGatherer maps_;
  const LogEvent* event_ = nullptr;
  std::map<std::string, McapWriter::ChannelId> channels_;
  std::map<std::string, McapWriter::SchemaId> schemas_;  // by their text
};

}  // namespace

McapExport export_mcap(const std::filesystem::path& log, const std::filesystem::path& mcap) {
  AtomicFile file(mcap);
  Exporter exporter(file.stream());
  McapExport result;
  scan_whole_log(log, [&](const LogEvent& event) {
    ++result.events;
    if (!exporter.add(event)) ++result.faulty;
  });
  exporter.mcap().finish();
  file.commit();
  result.messages = exporter.mcap().messages();
  result.chunks = exporter.mcap().chunks();
  return result;
}

}  // namespace vantage
