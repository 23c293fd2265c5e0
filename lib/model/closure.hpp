/// The set-up of closed gradients (phyxel/physics/closing.hpp).
#pragma once

#include "phyxel/model.hpp"

namespace phyxel {

/// Finds the closing vectors of the bodies that ask for them, and their volumes: those of the
/// surface's inside, each changed by some percent where that closes the sums better. Masses stay.
/// @throws InputError naming the body if it has no closed surface
void close_gradients(Model& model);

}  // namespace phyxel
