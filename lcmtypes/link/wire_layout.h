#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include <vantage/command_t.hpp>
#include <vantage/depth_map_chunk_t.hpp>
#include <vantage/depth_map_manifest_t.hpp>
#include <vantage/depth_map_receipt_t.hpp>
#include <vantage/depth_map_t.hpp>
#include <vantage/heartbeat_t.hpp>
#include <vantage/key_pose_t.hpp>
#include <vantage/motion_goal_t.hpp>
#include <vantage/preview_t.hpp>
#include <vantage/robot_state_t.hpp>
#include <vantage/session_config_t.hpp>
#include <vantage/status_t.hpp>
#include <vantage/trajectory_t.hpp>

namespace vantage {

/// The fields of a message type in the order of its .lcm file, so that a message's claims can be checked against its
/// length before the generated decoder allocates what it claims:
///
///   q i b   64-, 32- and 8-bit integer (boolean and byte too)      d   double
///   n       32-bit length of arrays that follow; the first is 0, the second 1, …
///   B0 I0 Q0 D0 S0   array of that length of bytes, 32- or 64-bit integers, doubles, strings      s   string
///
/// A number before a letter repeats it. A test compares every layout with the generated encoder.
template <typename Message>
inline constexpr std::string_view kWireLayout = {};

template <>
inline constexpr std::string_view kWireLayout<depth_map_t> = "5q 2i 2d 2d 3d 4d 2d n B0";
template <>
inline constexpr std::string_view kWireLayout<depth_map_manifest_t> = "4q 3i 32b";
template <>
inline constexpr std::string_view kWireLayout<depth_map_chunk_t> = "3q i n B0";
template <>
inline constexpr std::string_view kWireLayout<depth_map_receipt_t> = "4q b 32b n I0 I0";
template <>
inline constexpr std::string_view kWireLayout<motion_goal_t> = "4q 3d 4d";
template <>
inline constexpr std::string_view kWireLayout<key_pose_t> = "3q 3d 4d";
template <>
inline constexpr std::string_view kWireLayout<robot_state_t> = "4q b 3d 4d";
template <>
inline constexpr std::string_view kWireLayout<heartbeat_t> = "2q i 2b 4q s s";
template <>
inline constexpr std::string_view kWireLayout<session_config_t> = "q s";
template <>
inline constexpr std::string_view kWireLayout<command_t> = "5q b n B0";
template <>
inline constexpr std::string_view kWireLayout<status_t> = "2q b q n S0 Q0";
template <>
inline constexpr std::string_view kWireLayout<trajectory_t> = "3q n D0";
template <>
inline constexpr std::string_view kWireLayout<preview_t> = "2q 2i n B0";

/// True when `bytes` (fingerprint included) is exactly as long as the layout and the lengths in it say, no length is
/// negative, and every string ends with its NUL. Reads nothing beyond `bytes`, allocates nothing.
bool layout_fits(std::string_view layout, std::span<const std::uint8_t> bytes);

}  // namespace vantage
