/// Detection of bodies that applied forces would move as a whole.
#pragma once

#include "solver/newton.hpp"

namespace phyxel {

/// Checks before a search for equilibrium that every body is supported against its loads. Forces
/// along an unsupported axis must cancel. So must torques about an unsupported axis, except for a
/// hundredth, since a body may turn slightly to align with its load.
/// @throws InputError naming the body, the force or torque, and what is missing. Collective.
void refuse_unsupported_bodies(const Model& model, const Balance& balance);

}  // namespace phyxel
