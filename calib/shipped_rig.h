#pragma once

#include <filesystem>
#include <string>

namespace vantage {

/// The rig file of this name that comes with Vantage ("youbot.yaml"): of the installation that the running program
/// belongs to, else of the source tree that it was built in. \throws InputError when neither has it.
std::filesystem::path shipped_rig(const std::string& name);

}  // namespace vantage
