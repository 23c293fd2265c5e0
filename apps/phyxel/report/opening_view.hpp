/// The view with which the page of a trajectory opens.
#pragma once

#include <nlohmann/json.hpp>
#include <vector>

#include "camera_path.hpp"
#include "report/replay_data.hpp"

namespace phyxel::app {

/// The data that a page has of its camera and of the space around the bodies. Lengths but "centre"
/// and "radius" [m] are in units of the radius, about the centre: "scale" and "low" of 16-bit
/// positions; "view", with yaw and pitch [rad] about "axes", the point "pivot" around which it
/// turns, its "distance" if the scene places it, its field of view and its orbit in videos
/// [degrees]; "outermost", points that it is to see; and "follow", the way of a followed body frame
/// by frame, if there is one.
/// @param way of the followed body in each frame [m]; none if no body is followed
nlohmann::ordered_json opening_view(const CameraWishes& wishes,
                                    const std::vector<Instance>& instances, const Extent& extent,
                                    const std::vector<Vec3d>& way);

}  // namespace phyxel::app
