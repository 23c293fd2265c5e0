/// Where a scene comes to rest, without stepping there.
#pragma once

#include <cstdint>
#include <functional>

#include "phyxel/backend.hpp"
#include "phyxel/model.hpp"
#include "phyxel/state.hpp"

namespace phyxel {

/// How far a search by Newton's method has come.
struct NewtonProgress {
  int step = 0;          ///< Newton's steps accepted so far.
  int iteration = 0;     ///< Conjugate gradients' iteration of the step under way; 0: none yet.
  double residual = 0;   ///< Of the last accepted step, of what is applied.
  double tolerance = 0;  ///< Below which the residual counts as rest.
  double inner_residual = 1;  ///< Of the linear equations, of theirs at the start.
  double energy = 0;          ///< Of the last accepted step [J]: deformation, loads, inertia.
};

/// Called after every evaluation of the forces, on all ranks at the same ones.
/// @returns whether to go on; one rank's `false` stops all
using NewtonObserver = std::function<bool(const NewtonProgress&)>;

/// When a search ends, and where it begins.
struct EquilibriumOptions {
  /// Of the residual force over what is applied: loads, weight and reactions, all by their
  /// Euclidean norms over all phyxels.
  double tolerance = 1e-8;
  int most_steps = 200;               ///< Newton's.
  NewtonObserver observer = nullptr;  ///< Null: nobody watches.
  /// Displacements [m] of an interrupted search, which goes on to the bit; null: at rest.
  const std::vector<Vec3d>* start = nullptr;
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
/// @throws InputError if a motion never ends, or a body is not held against its loads;
///   DivergedError, with the residual that is left, if none is found within `most_steps` or the
///   search gets nowhere; InterruptedError if the observer asks for it: the backend's state is then
///   that of the last accepted step
Equilibrium find_equilibrium(const Model& model, Backend& backend,
                             const EquilibriumOptions& options = {});

}  // namespace phyxel
