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
  int step = 0;               ///< Newton steps accepted so far.
  int iteration = 0;          ///< Iteration of conjugate gradients within the present step, from 1.
  double residual = 0;        ///< Relative residual of the last accepted step.
  double tolerance = 0;       ///< Relative residual at which the search ends.
  double inner_residual = 1;  ///< Residual of the linear system over its initial residual.
  double energy = 0;  ///< Energy of the last accepted step [J]: deformation, loads, inertia.
};

/// Callback after each evaluation of the forces, on all ranks alike. @returns true to continue;
/// `false` of one rank stops all ranks
using NewtonObserver = std::function<bool(const NewtonProgress&)>;

/// Stopping criteria and start of a search for equilibrium.
struct EquilibriumOptions {
  /// Tolerance of the residual force relative to the applied forces (loads, weight and reactions),
  /// by their Euclidean norms over all phyxels.
  double tolerance = 1e-8;
  int most_steps = 200;               ///< Largest number of Newton steps.
  NewtonObserver observer = nullptr;  ///< Observer; may be null.
  /// Displacements of an interrupted search [m], which then continues with the same bits; null to
  /// start at rest.
  const std::vector<Vec3d>* start = nullptr;
};

/// Result of a search for equilibrium.
struct Equilibrium {
  State state;                   ///< At rest; step and time are zero.
  double residual = 0;           ///< Relative residual at the end.
  int steps = 0;                 ///< Newton steps taken.
  std::int64_t evaluations = 0;  ///< Evaluations of the forces of all phyxels.
  /// What each obstacle and body would do in a second, on the phyxels of this rank, as words of
  /// exact sums (`ContactTerms`); empty without friction, where it follows from the state.
  std::vector<std::int64_t> contact = {};
  /// Forces of obstacles and bodies on the phyxels of this rank [N], shape [n]; likewise.
  std::vector<Vec3d> contact_force = {};
};

/// Finds a state in which the forces on each free phyxel vanish, under gravity, full loads, and
/// prescribed displacements at their ends. Newton's method starts at rest; its equations are solved
/// by conjugate gradients with differences of the backend's forces, so that all terms are included
/// and no matrix is formed. Steps are shortened if they would strain the body strongly or increase
/// its energy, so that of several equilibria a stable one near the path is found. Friction is that
/// of slips since the start of the search, or since each stage of it where obstacles or supports
/// move far.
/// @param backend backend of the model in double; receives the state found
/// @throws InputError if the backend is not in double, a motion has no end, or a body is not
///   supported against its loads; DivergedError, with the residual, if no equilibrium is found
///   within `most_steps` or the search stagnates; InterruptedError if the observer requests it: the
///   backend then has the state of the last accepted step
Equilibrium find_equilibrium(const Model& model, Backend& backend,
                             const EquilibriumOptions& options = {});

}  // namespace phyxel
