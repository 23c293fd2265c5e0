/// Forces, torques and work of the supports of fixed and moved phyxels.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "phyxel/backend.hpp"
#include "phyxel/model.hpp"
#include "phyxel/solver.hpp"
#include "phyxel/state.hpp"

namespace phyxel {

/// The reactions that act along the axes of each motion of a model, in the order of the motions,
/// at the solver's present state. The reaction on a phyxel is its mass times the acceleration that
/// is prescribed, less all other forces on it, those of other bodies included. For Verlet's method
/// it is the force that the step from the present time needs, so that the impulses of reactions and
/// of external forces over a run sum to the change of momentum, but for rounding; a motion that
/// starts abruptly has a large one at t = 0. For implicit steps internal forces are those at the
/// end of the last step. At equilibrium nothing accelerates. Sums are exact: they do not depend on
/// the number of threads and ranks. Costs one evaluation of the forces, and nothing without
/// motions. Of a share: those of the whole model; collective, for a solver that was made with the
/// model.
std::vector<Reaction> find_reactions(const Model& model, Backend& backend, const Solver& solver);

/// A number of a reaction: a column of `reactions.csv`.
struct ReactionColumn {
  const char* name;
  const char* unit;
  double (*value)(const Reaction&);
};
/// The numbers of a reaction, in the order of the columns.
std::span<const ReactionColumn> reaction_columns();

}  // namespace phyxel
