/// From a [[body]] of a scene file to body requests.
#pragma once

#include <string>
#include <vector>

#include "phyxel/scene.hpp"
#include "scene/scene_table.hpp"

namespace phyxel {

constexpr std::size_t most_bodies = 10000;

/// A selection of phyxels. @throws InputError unless the table has exactly one of its keys
Selection read_selection(const SceneTable& table);

/// Reads the path of something that moves: all of a motion but its selection and its axes.
/// @throws InputError unless the table has a term of it, and the keys that go with that
void read_path(const SceneTable& table, MotionRequest& motion);

/// One request, or one for each copy of an array.
std::vector<BodyRequest> body_requests(const SceneTable& body);

/// The names of the bodies in quotes, for messages; of more than eight, the first ones.
std::string names_of(const std::vector<BodyRequest>& bodies);

}  // namespace phyxel
