/// The set-up of closed gradients (phyxel/physics/closing.hpp).
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "phyxel/model.hpp"

namespace phyxel {

/// Finds the closing vectors of a body, and its volumes: those of the surface's inside, each
/// changed by some percent where that closes the sums better. Masses stay. The model may be a connected share: closing vectors have the same bits on any number of ranks,
/// and all ranks get the same result. Collective.
/// @param parts of the body. @param enclosed volume inside the body's surface [m³]
/// @param areas S of each phyxel of the body (`areas_of_phyxels`), undefined for ghosts [m²]
/// @returns why the body's sums cannot be closed; nothing if they are
std::optional<std::string> close_body(Model& model, std::span<Part> parts, double enclosed,
                                      std::vector<Vec3d> areas);

/// Adds to loads by volume what volumes have changed. @param before volume of each phyxel [m³]
void loads_follow_volumes(Model& model, const std::vector<double>& before);

/// Closes the gradients of the bodies of a whole model that ask for it.
/// @throws InputError naming the body if its sums cannot be closed
void close_gradients(Model& model);

}  // namespace phyxel
