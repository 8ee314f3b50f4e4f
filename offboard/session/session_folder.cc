#include "offboard/session/session_folder.h"

#include <system_error>

#include "calib/files/input_error.h"

namespace vantage {

SessionFolder make_session_folder(const std::filesystem::path& path, bool overwrite) {
  SessionFolder folder{path};
  std::error_code error;
  if (std::filesystem::exists(folder.log(), error) && !overwrite) {
    throw InputError(path.string() + ": holds a session already; give another folder, or --overwrite");
  }
  std::filesystem::create_directories(path, error);
  if (error) throw InputError(path.string() + ": can't be made: " + error.message());
  for (const auto& file :
       {folder.config(), folder.log(), folder.steps(), folder.scores(), folder.timing(), folder.map(), folder.mesh(),
        folder.cloud(), folder.page(), folder.truth(), folder.views()}) {
    std::filesystem::remove(file, error);
    if (error) throw InputError(file.string() + ": can't be removed: " + error.message());
  }
  return folder;
}

}  // namespace vantage
