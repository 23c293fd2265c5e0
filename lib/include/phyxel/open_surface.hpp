/// The surface of bodies that break.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "phyxel/model.hpp"
#include "phyxel/state.hpp"

namespace phyxel {

/// Finds the triangles of a surface that no crack crosses. A surfel belongs to the phyxel that is
/// nearest to it at rest, and a crack crosses a triangle if two of its surfels belong to phyxels
/// that have broken from each other, or that are of different fragments. Returns nothing if no
/// crack crosses any. Collective on a share, where the first rank has the triangles, and other
/// ranks get nothing.
/// @param all the triangles of the whole model, with global ids of surfels
/// @param broken the broken pairs of all ranks (`Solver::state`)
std::optional<std::vector<Triangle>> uncut_triangles(const Model& model,
                                                     std::span<const Triangle> all,
                                                     std::span<const PhyxelPair> broken);

}  // namespace phyxel
