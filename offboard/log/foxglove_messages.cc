#include "offboard/log/foxglove_messages.h"

#include <bit>
#include <limits>
#include <map>
#include <vector>

#include "offboard/log/json_text.h"
#include "offboard/log/state_colors.h"

namespace vantage {
namespace {

static_assert(std::endian::native == std::endian::little, "32FC1 is little-endian");

JsonText stamped(std::int64_t utime) {
  JsonText json;
  json.begin('{').key("timestamp").begin('{');
  json.key("sec").integer(utime / 1'000'000).key("nsec").integer(utime % 1'000'000 * 1000).end('}');
  return json;
}

void put_vector(std::string_view name, const Eigen::Vector3d& v, JsonText* json) {
  json->key(name).begin('{').key("x").number(v.x()).key("y").number(v.y()).key("z").number(v.z()).end('}');
}

void put_rotation(std::string_view name, const Eigen::Isometry3d& pose, JsonText* json) {
  const Eigen::Quaterniond q(pose.linear());
  json->key(name).begin('{').key("x").number(q.x()).key("y").number(q.y()).key("z").number(q.z());
  json->key("w").number(q.w()).end('}');
}

void put_numbers(std::string_view name, std::initializer_list<double> numbers, JsonText* json) {
  json->key(name).begin('[');
  for (const double number : numbers) json->number(number);
  json->end(']');
}

std::string image(std::string_view frame, const DepthMap& map, std::string_view encoding,
                  std::span<const std::uint8_t> data) {
  JsonText json = stamped(map.utime);
  json.key("frame_id").text(frame).key("width").integer(map.camera.width).key("height").integer(map.camera.height);
  json.key("encoding").text(encoding);
  json.key("step").integer(static_cast<std::int64_t>(data.size()) / map.camera.height).key("data").base64(data);
  return json.end('}').str();
}

std::string float_image(std::string_view frame, const DepthMap& map, const std::vector<float>& values) {
  std::vector<float> shown = values;
  for (std::size_t i = 0; i < shown.size(); ++i) {
    if (!has_depth(map.state[i])) shown[i] = std::numeric_limits<float>::quiet_NaN();
  }
  return image(frame, map, "32FC1",
               {reinterpret_cast<const std::uint8_t*>(shown.data()), shown.size() * sizeof(float)});
}

}  // namespace

std::string foxglove_pose(std::int64_t utime, std::string_view frame, const Eigen::Isometry3d& pose) {
  JsonText json = stamped(utime);
  json.key("frame_id").text(frame).key("pose").begin('{');
  put_vector("position", pose.translation(), &json);
  put_rotation("orientation", pose, &json);
  return json.end('}').end('}').str();
}

std::string foxglove_transform(std::int64_t utime, std::string_view parent, std::string_view child,
                               const Eigen::Isometry3d& T_parent_child) {
  JsonText json = stamped(utime);
  json.key("parent_frame_id").text(parent).key("child_frame_id").text(child);
  put_vector("translation", T_parent_child.translation(), &json);
  put_rotation("rotation", T_parent_child, &json);
  return json.end('}').str();
}

std::string foxglove_calibration(std::int64_t utime, std::string_view frame, const CameraModel& camera) {
  JsonText json = stamped(utime);
  json.key("frame_id").text(frame).key("width").integer(camera.width).key("height").integer(camera.height);
  json.key("distortion_model").text("");
  put_numbers("D", {}, &json);
  put_numbers("K", {camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1}, &json);
  put_numbers("R", {1, 0, 0, 0, 1, 0, 0, 0, 1}, &json);
  put_numbers("P", {camera.fx, 0, camera.cx, 0, 0, camera.fy, camera.cy, 0, 0, 0, 1, 0}, &json);
  return json.end('}').str();
}

std::string foxglove_depth_image(std::string_view frame, const DepthMap& map) {
  return float_image(frame, map, map.depth_m);
}

std::string foxglove_sigma_image(std::string_view frame, const DepthMap& map) {
  return float_image(frame, map, map.sigma_m);
}

std::string foxglove_state_image(std::string_view frame, const DepthMap& map) {
  std::vector<std::uint8_t> colors;
  for (const DepthState state : map.state) {
    const std::array<std::uint8_t, 3> color = color_of(state);
    colors.insert(colors.end(), color.begin(), color.end());
  }
  return image(frame, map, "rgb8", colors);
}

std::string foxglove_jpeg(std::int64_t utime, std::string_view frame, std::span<const std::uint8_t> jpeg) {
  JsonText json = stamped(utime);
  return json.key("frame_id").text(frame).key("data").base64(jpeg).key("format").text("jpeg").end('}').str();
}

std::string foxglove_schema(std::string_view type) {
  const std::string text = R"({"type":"string"})", number = R"({"type":"number"})", integer = R"({"type":"integer"})";
  const std::string bytes = R"({"type":"string","contentEncoding":"base64"})";
  const std::string numbers = R"({"type":"array","items":)" + number + "}";
  using Properties = std::vector<std::pair<std::string, std::string>>;
  const auto object = [](const std::string& title, const Properties& properties) {
    std::string schema = R"({"type":"object","title":")" + title + R"(","properties":{)";
    for (const auto& [name, value] : properties) {
      schema.append(schema.back() == '{' ? "\"" : ",\"").append(name).append("\":").append(value);
    }
    return schema + "}}";
  };
  const std::string time = object("time", {{"sec", integer}, {"nsec", integer}});
  const std::string vector = object("foxglove.Vector3", {{"x", number}, {"y", number}, {"z", number}});
  const std::string quaternion =
      object("foxglove.Quaternion", {{"x", number}, {"y", number}, {"z", number}, {"w", number}});
  const std::string pose = object("foxglove.Pose", {{"position", vector}, {"orientation", quaternion}});
  const std::map<std::string_view, Properties> types{
      {"foxglove.PoseInFrame", {{"timestamp", time}, {"frame_id", text}, {"pose", pose}}},
      {"foxglove.FrameTransform",
       {{"timestamp", time},
        {"parent_frame_id", text},
        {"child_frame_id", text},
        {"translation", vector},
        {"rotation", quaternion}}},
      {"foxglove.CameraCalibration",
       {{"timestamp", time},
        {"frame_id", text},
        {"width", integer},
        {"height", integer},
        {"distortion_model", text},
        {"D", numbers},
        {"K", numbers},
        {"R", numbers},
        {"P", numbers}}},
      {"foxglove.RawImage",
       {{"timestamp", time},
        {"frame_id", text},
        {"width", integer},
        {"height", integer},
        {"encoding", text},
        {"step", integer},
        {"data", bytes}}},
      {"foxglove.CompressedImage", {{"timestamp", time}, {"frame_id", text}, {"data", bytes}, {"format", text}}},
  };
  return object(std::string(type), types.at(type));
}

}  // namespace vantage
