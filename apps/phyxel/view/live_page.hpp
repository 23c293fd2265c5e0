/// The page of a live view.
#pragma once

#include <string>

#include "view/live_picture.hpp"
#include "view/live_scene.hpp"

namespace phyxel::app {

/// The page that shows a scene and lets a user act on it. It asks the server that it comes from for
/// its stream of frames.
/// @param about the device and the precision, in words
std::string live_page(const LiveScene& live, const LivePicture& picture, const std::string& about);

}  // namespace phyxel::app
