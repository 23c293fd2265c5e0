/// The [[probe]] sections of a scene file.
#pragma once

#include <vector>

#include "phyxel/scene.hpp"
#include "scene/scene_table.hpp"

namespace phyxel {

/// Reads the probes of a scene file and adds each to its body.
/// @throws InputError naming the line, the key, its value and what is allowed
void read_probes(const SceneTable& root, std::vector<BodyRequest>& bodies);

}  // namespace phyxel
