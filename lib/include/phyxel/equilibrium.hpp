/// Equilibrium states, found by Newton's method instead of time steps.
#pragma once

#include <cstdint>
#include <functional>

#include "phyxel/backend.hpp"
#include "phyxel/model.hpp"
#include "phyxel/state.hpp"

namespace phyxel {

/// Progress of Newton's method.
struct NewtonProgress {
  int step = 0;          ///< Newton steps accepted so far.
  int iteration = 0;     ///< Iteration of conjugate gradients within the present step; 0: none yet.
  double residual = 0;   ///< Relative residual of the last accepted step.
  double tolerance = 0;  ///< Relative residual at which the search ends.
  double inner_residual = 1;  ///< Residual of the linear system over its initial residual.
  double energy = 0;  ///< Energy of the last accepted step [J]: deformation, loads, inertia.
};

/// Called after every evaluation of the forces, on all ranks at the same ones.
/// @returns whether to go on; one rank's `false` stops all
using NewtonObserver = std::function<bool(const NewtonProgress&)>;

/// Stopping criteria and start of a search for equilibrium.
struct EquilibriumOptions {
  /// Of the residual force over what is applied: loads, weight and reactions, all by their
  /// Euclidean norms over all phyxels.
  double tolerance = 1e-8;
  int most_steps = 200;               ///< Newton's.
  NewtonObserver observer = nullptr;  ///< Null: no observer.
  /// Displacements [m] of an interrupted search, which goes on to the bit; null: at rest.
  const std::vector<Vec3d>* start = nullptr;
};

/// Result of a search for equilibrium.
struct Equilibrium {
  State state;                   ///< At rest; step and time are zero.
  double residual = 0;           ///< Relative residual at the end.
  int steps = 0;                 ///< Newton steps taken.
  std::int64_t evaluations = 0;  ///< Evaluations of the forces of all phyxels.
};

/// A state in which forces cancel on every phyxel that is not held: under gravity, loads at their
/// full size, and motions at their ends. Newton's method from the state at rest, its equations
/// solved by conjugate gradients over differences of the backend's forces, so that every term
/// counts and no matrix is made. Steps are cut where they would strain the body by much, or would
/// raise its energy: of several equilibria it is a stable one near the way there.
/// @param backend of the model, in double; its state is the one found
/// @throws InputError if a motion never ends, or a body is not held against its loads;
///   DivergedError, with the residual that is left, if none is found within `most_steps` or the
///   search gets nowhere; InterruptedError if the observer asks for it: the backend's state is then
///   that of the last accepted step
Equilibrium find_equilibrium(const Model& model, Backend& backend,
                             const EquilibriumOptions& options = {});

}  // namespace phyxel
