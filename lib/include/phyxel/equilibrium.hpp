/// Where a scene comes to rest, without stepping there.
#pragma once

#include <cstdint>

#include "phyxel/backend.hpp"
#include "phyxel/model.hpp"
#include "phyxel/state.hpp"

namespace phyxel {

/// When a search ends.
struct EquilibriumOptions {
  /// Of the residual force over what is applied: loads, weight and reactions, all by their
  /// Euclidean norms over all phyxels.
  double tolerance = 1e-8;
  int most_steps = 200;  ///< Newton's.
};

/// What a search has found.
struct Equilibrium {
  State state;                   ///< At rest; step and time are zero.
  double residual = 0;           ///< What is left of it.
  int steps = 0;                 ///< Newton's.
  std::int64_t evaluations = 0;  ///< Of the forces of all phyxels.
};

/// A state in which forces cancel on every phyxel that is not held: under gravity, loads at their
/// full size, and motions at their ends. Newton's method from the state at rest, its equations
/// solved by conjugate gradients over differences of the backend's forces, so that every term
/// counts and no matrix is made. Steps are cut where they would strain the body by much, or would
/// raise its energy: of several equilibria it is a stable one near the way there.
/// @param backend of the model, in double; its state is the one found
/// @throws InputError if a motion never ends, or nothing holds the body against its loads;
///   DivergedError if none is found within `most_steps`
Equilibrium find_equilibrium(const Model& model, Backend& backend,
                             const EquilibriumOptions& options = {});

}  // namespace phyxel
