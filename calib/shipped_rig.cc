#include "calib/shipped_rig.h"

#include "calib/files/input_error.h"

namespace vantage {

std::filesystem::path shipped_rig(const std::string& name) {
  namespace fs = std::filesystem;
  std::error_code error;
  const fs::path bin = fs::read_symlink("/proc/self/exe", error).parent_path();
  // PREFIX/bin and PREFIX/share/vantage; BUILD/PRESET/bin inside the source tree.
  for (const char* from_bin : {"../share/vantage/rigs", "../../../calib/rigs"}) {
    fs::path rig = (bin / from_bin / name).lexically_normal();
    if (fs::is_regular_file(rig, error)) return rig;
  }
  throw InputError(name + ": no such rig comes with this program; give one with --rig FILE");
}

}  // namespace vantage
