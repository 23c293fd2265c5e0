/// Forces and energy of contact by penalties at an instant of Verlet's steps.
#pragma once

#include <vector>

#include "exact_sum.hpp"
#include "phyxel/backend.hpp"
#include "phyxel/model.hpp"
#include "phyxel/state.hpp"

namespace phyxel {

/// What penalties do at an instant.
struct PresentContact {
  std::vector<Vec3d> force;      ///< [N], shape [n]; empty in models without penalties.
  std::vector<Vec3d> of_bodies;  ///< The part of it that other bodies exert [N].
  ExactSum energy;               ///< Of the springs of this rank's points [J].
  ExactSum energy_of_bodies;     ///< The part of it between bodies [J].
};

/// Finds the forces and the energy of penalties at the present state of a backend: those of the
/// next step, without friction. Of a share: collective.
/// @param state as downloaded. @param time [s]. @param dt size of the step [s]
PresentContact present_contact(const Model& model, Backend& backend, const State& state,
                               double time, double dt);

}  // namespace phyxel
