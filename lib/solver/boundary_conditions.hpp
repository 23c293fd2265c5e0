/// Loads and prescribed motions of a model, shared by all solvers.
#pragma once

#include <cmath>
#include <utility>
#include <vector>

#include "phyxel/model.hpp"
#include "phyxel/solver.hpp"

namespace phyxel {

/// The time at which every load has its full size [s].
inline constexpr double full_loads = HUGE_VAL;

/// Returns the time [s] of the loads that act at a solver's present state.
inline double time_of_loads(const Solver& solver) {
  return solver.method() == Method::equilibrium ? full_loads : solver.time();
}

/// Returns the share of each load that acts at `time` [s].
inline std::vector<double> load_scales(const Model& model, double time) {
  std::vector<double> scales;
  for (const Load& load : model.loads) scales.push_back(load.scale_at(time));
  return scales;
}

/// Calls add(phyxel, force) for the force at rest [N] of every load on every phyxel, either of the
/// loads that follow the surface or of the others. @param time [s]
template <class Add>
void for_each_load(const Model& model, bool following, double time, Add&& add) {
  for (const Load& load : model.loads) {
    if (load.follows != following) continue;
    const double scale = load.scale_at(time);
    for (std::size_t k = 0; k < load.phyxels.size(); ++k) {
      add(load.phyxels[k], scale * load.force[k]);
    }
  }
}

/// Adds the loads that do not follow the surface to forces [N], shape [n]. @param time [s]
inline void add_constant_loads(const Model& model, double time, std::vector<Vec3d>& force) {
  for_each_load(model, false, time, [&](Index i, Vec3d load) { force[i] += load; });
}
/// Adds all loads of a body at rest to forces [N], shape [n]. @param time [s]
inline void add_loads_at_rest(const Model& model, double time, std::vector<Vec3d>& force) {
  add_constant_loads(model, time, force);
  for_each_load(model, true, time, [&](Index i, Vec3d load) { force[i] += load; });
}
/// Returns 1 for the free axes of each phyxel and 0 for prescribed ones, shape [n]. Empty for a
/// model without prescribed motions.
inline std::vector<Vec3d> free_axes(const Model& model) {
  std::vector<Vec3d> free(model.motions.empty() ? 0 : static_cast<std::size_t>(model.size()),
                          {1, 1, 1});
  for (const Motion& motion : model.motions) {
    for (const Index i : motion.phyxels) free[i] = motion.along_axes({}, free[i]);
  }
  return free;
}

/// Sets the displacements that motions prescribe at `time` [s]; others do not change.
/// @param displacement [m], shape [n]
inline void prescribe_displacements(const Model& model, double time,
                                    std::vector<Vec3d>& displacement) {
  for (const Motion& motion : model.motions) {
    const Path path = motion.path_at(time);
    for (const Index i : motion.phyxels) {
      displacement[i] = motion.along_axes(path.at(model.position[i]), displacement[i]);
    }
  }
}

}  // namespace phyxel
