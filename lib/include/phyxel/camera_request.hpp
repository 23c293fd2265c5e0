/// The camera that a scene asks for.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "phyxel/types.hpp"

namespace phyxel {

/// The camera of pictures and of a report's opening view, beside `RenderRequest::view` and `up`.
struct CameraRequest {
  std::optional<Vec3d> position;  ///< Place of the camera [m]; unset: where it sees all bodies.
  std::optional<Vec3d> target;    ///< Point in the middle of the picture [m]; unset: none.
  double field_of_view = 30;      ///< Along the shorter side of the picture [degrees].
  double orbit = 0;               ///< Turn about `up` from the first to the last picture [degrees].
  std::string follow;  ///< Name of the body whose centre the camera moves with; "": none.
};

/// Reads the camera in the text of a scene (`[render.camera]`). With a position and a target, the
/// direction from one to the other is the view that `parse_render` returns. @param file names the
/// text in messages @throws InputError
CameraRequest parse_camera(const std::string& text, const std::filesystem::path& file);

}  // namespace phyxel
