#pragma once

#include <filesystem>

namespace vantage {

/// The files of one run.
struct SessionFolder {
  std::filesystem::path path;

  std::filesystem::path config() const { return path / "config.yaml"; }
  std::filesystem::path log() const { return path / "log.lcm"; }        ///< all that came in and all goals
  std::filesystem::path steps() const { return path / "steps.csv"; }    ///< one line a view: what was decided
  std::filesystem::path scores() const { return path / "scores.csv"; }  ///< one line a candidate and step
  std::filesystem::path timing() const { return path / "timing.csv"; }  ///< how long each step took here
  std::filesystem::path map() const { return path / "map.ot"; }
  std::filesystem::path mesh() const { return path / "mesh.ply"; }    ///< marching cubes on the signed distance
  std::filesystem::path cloud() const { return path / "cloud.ply"; }  ///< reconstructed points with normals
  std::filesystem::path page() const { return path / "view.html"; }   ///< the cloud and the cameras, for a browser
  std::filesystem::path truth() const { return path / "truth.ply"; }  ///< copy of the true surface, where given
  std::filesystem::path views() const { return path / "views.txt"; }  ///< copy of the candidate file, where given
};

/// Makes the folder, or takes an empty one, or with `overwrite` one that holds an earlier session: that session's files
/// are removed, other files stay.
/// \throws InputError when it holds a session and may not be overwritten, or can't be made.
SessionFolder make_session_folder(const std::filesystem::path& path, bool overwrite);

}  // namespace vantage
