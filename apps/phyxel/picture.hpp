/// Pictures of a trajectory.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "camera_path.hpp"
#include "compose.hpp"
#include "phyxel/scene.hpp"
#include "trajectory.hpp"
#include "video.hpp"

namespace phyxel::app {

struct PictureRequest {
  int width = 960, height = 720;        ///< [px]
  CameraOptions camera;                 ///< In place of the camera of the scene.
  bool phyxels = true, surface = true;  ///< Families that are drawn, if they exist.
  /// True for a floor below the bodies, if the scene has no obstacles and the camera looks down.
  bool floor = true;
  FrameChoice choice;
  std::string colour;  ///< Name of a field of the frames that colours show; "": bodies differ.
  /// Range of the colours; unset: that of most values of the frames that are drawn.
  std::optional<std::pair<double, double>> range = {};
  Scale scale =
      Scale::automatic;  ///< Of the colours; linear if it is automatic and `range` is set.
  std::string cut = {};  ///< Plane that cuts bodies (`cut_plane`); "": they are drawn whole.
  /// Folder of the scene, from which it names meshes; empty: the current one.
  std::filesystem::path scene_folder = {};
};

/// Draws the frames of a run's folder (phyxels and surface), a series file or a frame file, with
/// the camera that is wished, by default one that sees the whole motion. Pictures of a series are
/// `folder`/frame_<number>.png; the picture of a single frame has its name.
/// @returns the files written, in order of time
/// @throws InputError if there is nothing to draw, or, without `overwrite`, if one of the pictures
///   exists (none is written then); OutputError if writing fails
std::vector<std::filesystem::path> render(const std::filesystem::path& input,
                                          const std::filesystem::path& folder,
                                          const PictureRequest& request, bool overwrite);

/// Draws the frames of a run's folder, a series file or a frame file as `render` does, into a
/// video. A single frame is drawn for four seconds if the camera turns.
/// @returns the number of its pictures
/// @throws InputError, also as `check_video` and `render`; OutputError if encoding or writing fails
std::size_t render_video(const std::filesystem::path& input, const VideoRequest& video,
                         const PictureRequest& request, bool overwrite);

/// Draws some frames of a run's folder, as its scene asks, into `out`/pictures at the end of the
/// run. With `overwrite`, pictures of an earlier run are removed.
std::vector<std::filesystem::path> render_directory(const std::filesystem::path& out,
                                                    const Scene& scene, bool overwrite);

}  // namespace phyxel::app
