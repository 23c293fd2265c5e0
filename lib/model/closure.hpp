/// The set-up of closed gradients (phyxel/physics/closing.hpp).
#pragma once

#include <optional>

#include "phyxel/model.hpp"

namespace phyxel {

/// @param volume of all phyxels [m³], where it is the geometry's
/// @throws InputError if a body asks for closure but has no surface that encloses about that volume
void check_closure(const BodyRequest& request, const Surface& surface,
                   std::optional<double> volume);

/// Finds the closing vectors of the bodies that ask for them, and their volumes: those of the
/// surface's inside, each changed by some percent where that closes the sums better. Masses stay;
/// loads by volume follow.
/// @throws InputError naming the body if its sums cannot be closed
void close_gradients(Model& model);

}  // namespace phyxel
