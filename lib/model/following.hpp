/// The set-up of loads that follow the surface.
#pragma once

#include "phyxel/model.hpp"

namespace phyxel {

/// Finds where the loads of a model or a connected share follow the surface (`Model::following`).
void find_following(Model& model);

}  // namespace phyxel
