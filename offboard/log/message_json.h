#pragma once

#include <string>

#include "offboard/log/known_channels.h"

namespace vantage {

/// A message as a JSON object with the .lcm file's field names. Arrays of bytes are base64; random 64-bit ids
/// (sessions, boots) are strings, for JavaScript's numbers would lose their last digits. A depth map's packed images
/// are left out: readers get them unpacked.
std::string message_json(const ChannelSchema& schema, const MessageFields& message);

/// The JSON schema (draft 2020-12) of what message_json gives.
std::string json_schema(const ChannelSchema& schema);

}  // namespace vantage
