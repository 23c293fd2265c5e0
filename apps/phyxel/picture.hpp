/// Pictures of a trajectory: which frames, seen from where, written to which files.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "compose.hpp"
#include "phyxel/scene.hpp"
#include "trajectory.hpp"

namespace phyxel::app {

struct PictureRequest {
  int width = 960, height = 720;  ///< [px]
  /// Direction the camera looks along, and the one that is up; unset: as the frames' scene has it.
  std::optional<Vec3d> view, up;
  bool phyxels = true, surface = true;  ///< What is drawn, as far as there is any.
  FrameChoice choice;
};

/// Draws the frames of a run's folder (phyxels and surface), of one series file, or of one frame
/// file, with one camera that sees the whole motion. Pictures of a series are
/// `folder`/frame_<number>.png, that of a single frame bears its name.
/// @returns the files written, in order of time.
/// @throws InputError if there is nothing to draw, or, unless `overwrite`, if one of the pictures
///   exists (none is written then); OutputError if writing fails.
std::vector<std::filesystem::path> render(const std::filesystem::path& input,
                                          const std::filesystem::path& folder,
                                          const PictureRequest& request, bool overwrite);

/// What a run does at its end: draws `request.count` frames of the run's folder into
/// `out`/pictures. With `overwrite`, pictures of an earlier run of that folder are removed.
std::vector<std::filesystem::path> render_directory(const std::filesystem::path& out,
                                                    const RenderRequest& request, bool overwrite);

}  // namespace phyxel::app
