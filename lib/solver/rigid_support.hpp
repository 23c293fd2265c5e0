/// Bodies that what is applied would move as a whole.
#pragma once

#include "solver/newton.hpp"

namespace phyxel {

/// Checks, before a search for rest, that every body is held against what is applied to it. Forces
/// along an axis that a body is not held along must cancel; so must torques about an axis that it
/// may turn about, but for a hundredth, which a body may turn into its load.
/// @throws InputError naming the body, the force or torque, and what is missing. Collective.
void refuse_unsupported_bodies(const Model& model, const Balance& balance);

}  // namespace phyxel
