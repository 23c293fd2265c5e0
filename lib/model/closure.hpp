/// The set-up of closed gradients (phyxel/physics/closing.hpp).
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "phyxel/model.hpp"

namespace phyxel {

/// A body whose gradients shall be closed.
struct ClosedBody {
  std::span<Part> parts;
  double enclosed = 0;  ///< Volume inside its surface [m³].
};

/// Finds the closing vectors of bodies, and their volumes: those of the surface's inside, each
/// changed by some percent where that closes the sums better. Masses stay; loads by volume follow.
/// The model may be a connected share: closing vectors have the same bits on any number of ranks,
/// and all ranks get the same result. Collective.
/// @param bodies in the order of the model's
/// @param areas S of each phyxel of the model (`areas_of_phyxels`), undefined for ghosts [m²]
/// @returns why the sums of a body cannot be closed; nothing if they are
std::optional<std::string> close_bodies(Model& model, const std::vector<ClosedBody>& bodies,
                                        std::vector<Vec3d> areas);

/// Closes the gradients of the bodies of a whole model that ask for it.
/// @throws InputError naming the body if its sums cannot be closed
void close_gradients(Model& model);

}  // namespace phyxel
